//! Tracks: blobs of consecutive slices of one object, associated by prediction with constant velocity.

use crate::blobs::{Blob, SLICE_NANOS};
use crate::settings::Kind;

/// A track that was not observed for this time ends, ns. The time is shorter for a track of few blobs, whose velocity
/// is unknown.
const MAX_PAUSE_NANOS: i64 = 450_000_000;
const MAX_PAUSE_OF_NEW_NANOS: i64 = 250_000_000;
const N_OF_NEW: usize = 4;

/// Share of a new velocity measurement in the velocity of a track: the visible part of an object changes from slice to slice.
const GAIN: f64 = 0.4;

/// Error of a predicted center: m, and lengths of a typical object for each slice since the last blob, because the visible part of an
/// object changes from slice to slice.
const GATE_M: f64 = 0.3;
const GATE_LENGTHS: f64 = 0.33;

/// Blobs of one object.
#[derive(Clone, Debug)]
pub(crate) struct Track {
    /// Indices of its blobs in time order, at most one per slice.
    pub(crate) blobs: Vec<usize>,
    /// Velocity at the last blob, m/s.
    velocity: [f64; 2],
}

impl Track {
    fn add(&mut self, idx: usize, blobs: &[Blob]) {
        let last = &blobs[self.blobs[self.blobs.len() - 1]];
        let new = &blobs[idx];
        let seconds = seconds_between(last, new);
        let gain = if self.blobs.len() == 1 { 1.0 } else { GAIN };
        for axis in 0..2 {
            let measured = (new.center[axis] - last.center[axis]) / seconds;
            self.velocity[axis] += gain * (measured - self.velocity[axis]);
        }
        self.blobs.push(idx);
    }

    /// Distance of a blob from the predicted center as a share of the gate; `None` outside the gate.
    fn distance(&self, new: &Blob, blobs: &[Blob], kind: &Kind) -> Option<f64> {
        let last = &blobs[self.blobs[self.blobs.len() - 1]];
        let seconds = seconds_between(last, new);
        let error_mps = GATE_LENGTHS * kind.length_m / (SLICE_NANOS as f64 * 1e-9);
        // The velocity of a new track is unknown.
        let gate_m = GATE_M + seconds * if self.blobs.len() == 1 { kind.max_speed_mps } else { error_mps };
        let off = |axis: usize| new.center[axis] - last.center[axis] - self.velocity[axis] * seconds;
        let distance = off(0).hypot(off(1)) / gate_m;
        (distance <= 1.0).then_some(distance)
    }
}

fn seconds_between(earlier: &Blob, later: &Blob) -> f64 {
    // Blobs of neighboring slices may have been observed at nearly the same time, at the border of the slices.
    ((later.nanos - earlier.nanos) as f64 * 1e-9).max(0.01)
}

/// A blob that may continue a track.
struct Continuation {
    distance: f64,
    track: usize,
    blob: usize,
}

/// All tracks, in the order of their first blobs. Blobs are in the order of slices.
pub(crate) fn follow(blobs: &[Blob], kind: &Kind) -> Vec<Track> {
    let mut tracks: Vec<Track> = Vec::new();
    let mut active: Vec<usize> = Vec::new();
    let mut first = 0;
    for slice in blobs.chunk_by(|a, b| a.slice == b.slice) {
        let is_recent = |track: &Track, now: i64| {
            let pause = if track.blobs.len() < N_OF_NEW { MAX_PAUSE_OF_NEW_NANOS } else { MAX_PAUSE_NANOS };
            now - blobs[track.blobs[track.blobs.len() - 1]].nanos <= pause
        };
        let now = slice.iter().map(|blob| blob.nanos).min().unwrap_or_default();
        active.retain(|&track| is_recent(&tracks[track], now));
        let mut pairs: Vec<Continuation> = Vec::new();
        for (idx, blob) in (first..).zip(slice) {
            for &track in &active {
                if let Some(distance) = tracks[track].distance(blob, blobs, kind) {
                    pairs.push(Continuation { distance, track, blob: idx });
                }
            }
        }
        let in_order = |pair: &Continuation| (pair.track, pair.blob);
        pairs.sort_by(|a, b| a.distance.total_cmp(&b.distance).then(in_order(a).cmp(&in_order(b))));
        let mut is_taken = vec![false; slice.len()];
        let mut is_continued = vec![false; tracks.len()];
        for Continuation { track, blob: idx, .. } in pairs {
            if !is_taken[idx - first] && !is_continued[track] {
                is_taken[idx - first] = true;
                is_continued[track] = true;
                tracks[track].add(idx, blobs);
            }
        }
        for (idx, _) in (first..).zip(&is_taken).filter(|(_, is_taken)| !**is_taken) {
            active.push(tracks.len());
            tracks.push(Track { blobs: vec![idx], velocity: [0.0; 2] });
        }
        first += slice.len();
    }
    tracks
}
