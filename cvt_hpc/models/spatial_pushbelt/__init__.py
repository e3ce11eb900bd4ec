"""The spatial pushbelt of rigid elements on two flexible ring packages (Schindler 2008)."""
