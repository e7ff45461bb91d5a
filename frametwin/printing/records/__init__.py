"""What is written of a print: its sequence of struts, and the history of its batches. Needs numpy alone."""
