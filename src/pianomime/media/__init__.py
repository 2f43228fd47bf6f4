"""Media: files of sound and video, which may come from anybody, and their sound as samples."""
