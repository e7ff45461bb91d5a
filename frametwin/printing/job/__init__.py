"""A print job: a folder that is planned once and answers each batch's pictures."""
