"""Outside words to and from the model; pure functions, strict about everything that comes in."""
