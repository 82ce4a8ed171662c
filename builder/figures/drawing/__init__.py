"""What all figures share: canvas, colours, words, the unrolled body, marks of gauges, values under the pointer."""
