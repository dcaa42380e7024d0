"""A page that shows clips: one HTML file that needs nothing but a browser."""
