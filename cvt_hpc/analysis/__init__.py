"""What runs say together and one by one: maps of a study, pictures and files of a run's history."""
