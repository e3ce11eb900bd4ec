"""Layouts of the work space of a split belt, by name."""

# Layers of a station, and the entries of a symmetric block of both in Chain
ELEMENT, RING = range(2)
LAYERS = 2
ELEMENT_ELEMENT, ELEMENT_RING, RING_RING = range(3)

# Columns of Chain: the right side, and from there on c R by coordinates
RIGHT, BY_COORDINATE = range(2)

# Rows of Work.stations
ACROSS, ALONG, ALONG_RING, RADIAL_SLOPE, CROSS_SLOPE, TANGENTIAL_SLOPE, TANGENTIAL_CROSS = range(7)
RADIAL_SPEED, TANGENTIAL_SPEED, SADDLE_SPEED, MEETING, REVERSING, RING_REVERSING = range(7, 13)
ELEMENT_STRAIN_AHEAD, ELEMENT_STRESS, RING_STRESS, HOOP_STRESS = range(13, 17)
STATIONS = HOOP_STRESS + 1
