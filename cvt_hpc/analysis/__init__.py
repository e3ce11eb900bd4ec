"""What runs say: vibrations and their spectra, whether a run vibrates, maps of a study, charts of a run."""
