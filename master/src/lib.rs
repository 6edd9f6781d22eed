//! The master: split, schedule, stitch.
