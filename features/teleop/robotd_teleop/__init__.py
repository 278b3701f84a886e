"""A robot that follows another one, which a person moves by hand."""
