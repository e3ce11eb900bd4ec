"""The planar pushbelt of Geier and Schindler: elements, ring and sheaves with contacts that open and slide."""
