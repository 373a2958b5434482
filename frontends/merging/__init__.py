"""Two maps of one building made one: where one lies in the other by WiFi and the laser, and when that is believed."""
