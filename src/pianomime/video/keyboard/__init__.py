"""The keyboard in a picture: found by its black keys, or from points that a person marked."""
