"""The radio map of a building: the level of each access point over it, where it stands, and what all of them cover."""
