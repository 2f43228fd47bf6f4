"""From a video of a person who plays, to a Demonstration.

Four rooms find what the video shows: `film` reads it, `keyboard` locates the keys, `hands` tracks
the fingertips, `notes` finds the notes and the finger that plays each. `retarget` puts them
together; `overlay` and `summary` show how well it went.
"""
