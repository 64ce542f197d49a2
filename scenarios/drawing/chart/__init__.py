"""Charts that a reader can zoom, move and read values from; uPlot draws them, without a connection."""
