//! The cluster's wire protocol: generated types and their conversions to and from the core.
