//! The stage on hand-made and real recordings, offline and live.

mod doubts;
mod live;
mod live_rig;
mod live_senders;
mod live_two_lidars;
mod secondary_lidars;
mod step;
mod support;
