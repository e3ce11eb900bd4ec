"""What several modules of the tests share."""
