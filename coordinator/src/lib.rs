//! Coordinator of campaigns.
