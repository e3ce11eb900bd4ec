"""The judgement of one run: amplitude, spectrum, frequency, growth, and whether it vibrates."""
