"""The next experiment: the motion that tells apart what the records leave confounded."""
