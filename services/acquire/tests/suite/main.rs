//! The stage on hand-made and real recordings, offline and live.

mod doubts;
mod live;
mod live_rig;
mod step;
mod support;
