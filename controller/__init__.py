"""What is commanded: estimators, controllers, supervision and limits; sees the models only."""
