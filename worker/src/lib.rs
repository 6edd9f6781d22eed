//! One digitizing worker.
