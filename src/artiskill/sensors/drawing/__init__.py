"""Drawing: surfaces, poses and cameras to buffers, and buffers to colours."""
