"""The axes of a building, along which its walls stand and robots mostly drive, and the headings that they tell."""
