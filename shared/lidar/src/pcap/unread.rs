//! Descriptions of the frames of a capture that are not read, for captures without a packet of a sensor.

use super::blocks::{Next, Records};
use super::link::{description, udp};
use std::collections::BTreeMap;
use std::path::Path;

/// Frames that are examined.
const MAX_FRAMES: usize = 65_536;
/// Kinds of frames that are described.
const MAX_KINDS: usize = 3;

/// One text for each of the most frequent kinds, or that the capture has no packets. Errors of a capture are reported when it is read.
pub(crate) fn unread_frames(path: &Path) -> Vec<String> {
    let Ok(mut records) = Records::open(path) else { return Vec::new() };
    let mut kinds: BTreeMap<String, usize> = BTreeMap::new();
    let mut n_frames = 0;
    while n_frames < MAX_FRAMES
        && let Ok(Next::Record(record)) = records.next()
    {
        n_frames += 1;
        if udp(record.link, records.frame()).is_none() {
            *kinds.entry(description(record.link, records.frame())).or_default() += 1;
        }
    }
    if n_frames == 0 {
        return vec!["the capture has no packets".to_owned()];
    }
    let mut kinds: Vec<(String, usize)> = kinds.into_iter().collect();
    kinds.sort_by_key(|(_, n)| std::cmp::Reverse(*n));
    kinds.into_iter().take(MAX_KINDS).map(|(kind, n)| format!("{n} frames {kind}")).collect()
}
