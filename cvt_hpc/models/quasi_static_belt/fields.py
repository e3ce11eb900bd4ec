"""Layout of the work space of stations of the split belt, by name."""

# rows of Work.stations
(
    ACROSS,
    ALONG,
    ALONG_RING,
    RADIAL_SLOPE,
    CROSS_SLOPE,
    TANGENTIAL_SLOPE,
    TANGENTIAL_CROSS,
    RADIAL_SPEED,
    TANGENTIAL_SPEED,
    STIFFNESS_OF_SADDLE,
    SADDLE_SPEED,
    UNSTRESSED,
    MEETING,
    REVERSING,
    RING_REVERSING,
    ELEMENT_STRAIN_AHEAD,
    ELEMENT_STRESS,
    RING_STRESS,
    HOOP_STRESS,
    ELEMENT_HOOP,
    RING_HOOP,
) = range(21)
