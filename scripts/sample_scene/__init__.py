"""The procedural village that scripts/make_data_samples.py photographs."""
