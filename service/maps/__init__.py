"""What is done with saved maps: closures vetoed and restored, two maps merged, one aligned to a floor plan."""
