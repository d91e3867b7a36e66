//! Images that wait for the sweep of their time.

use crate::error::LiveError;
use crate::live::clocks::Clocks;
use crate::live::images::{ArrivedImage, CameraKind, ImageCounts, ImageWatch};
use crate::recorded::{Odometer, Trigger};
use drive::Frame;
use geometry::Stamp;
use lidar::nmea::Fix;
use std::collections::{BTreeMap, VecDeque};

/// Largest number of images that wait for a sweep. A clock that is ahead of the LiDAR's would otherwise fill the
/// memory.
const MAX_WAITING: usize = 10_000;
/// Fixes that the trigger rule needs: 100 s at 10 Hz.
const MAX_FIXES: usize = 1000;

/// An image to publish.
#[derive(Clone, Debug)]
pub enum DueFrame {
    /// Image of a color camera.
    Color(Frame),
    /// Image of a mosaic camera.
    Mosaic(Frame),
}

/// Numbers of images by outcome.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FrameCounts {
    /// Before the first sweep.
    pub(super) before: u64,
    /// After the last sweep, or left out because too many waited for a sweep.
    pub(super) after: u64,
    /// Arrived too late after the sweep of their time.
    pub(super) late: u64,
    skipped_images: u64,
    skipped_mosaics: u64,
    files: ImageCounts,
}

/// The watched folders and the images that wait.
pub(super) struct Frames {
    watch: ImageWatch,
    /// Name of each camera among the clocks.
    names: BTreeMap<(CameraKind, usize), String>,
    waiting: BTreeMap<(i64, CameraKind, usize), Frame>,
    /// Number of recorded images of each camera.
    received: BTreeMap<(CameraKind, usize), u64>,
    trigger: Trigger,
    last_of: BTreeMap<(CameraKind, usize), Stamp>,
    fixes: VecDeque<Fix>,
    counts: FrameCounts,
    reported: FrameCounts,
}

impl Frames {
    pub(super) fn new(watch: ImageWatch, names: BTreeMap<(CameraKind, usize), String>, trigger: Trigger) -> Self {
        Self {
            watch,
            names,
            waiting: BTreeMap::new(),
            received: BTreeMap::new(),
            trigger,
            last_of: BTreeMap::new(),
            fixes: VecDeque::new(),
            counts: FrameCounts::default(),
            reported: FrameCounts::default(),
        }
    }

    pub(super) fn add_fix(&mut self, fix: &Fix) {
        if self.fixes.len() == MAX_FIXES {
            self.fixes.pop_front();
        }
        self.fixes.push_back(*fix);
    }

    pub(super) fn take_arrived(&mut self, clocks: &mut Clocks) -> Result<(), LiveError> {
        if let Some(error) = self.watch.take_error() {
            return Err(error);
        }
        for ArrivedImage { kind, frame, arrived } in self.watch.take() {
            let camera = (kind, frame.camera);
            *self.received.entry(camera).or_default() += 1;
            if let (Some(name), Some(arrived)) = (self.names.get(&camera), arrived) {
                clocks.add(name, frame.stamp, arrived);
            }
            self.waiting.insert((frame.stamp.0, kind, frame.camera), frame);
        }
        while self.waiting.len() > MAX_WAITING {
            self.waiting.pop_first();
            self.counts.after += 1;
        }
        Ok(())
    }

    /// The oldest image before the end of the last sweep. Counts and skips images before the first sweep, images that
    /// arrive more than `max_late` after the end of the last sweep, and images that the trigger rule leaves out.
    pub(super) fn next_due(&mut self, [begin, end]: [i64; 2], max_late: i64) -> Option<DueFrame> {
        while let Some(first) = self.waiting.first_entry().filter(|first| first.key().0 < end) {
            let ((stamp, kind, camera), frame) = first.remove_entry();
            if stamp < begin {
                self.counts.before += 1;
            } else if stamp < end.saturating_sub(max_late) {
                self.counts.late += 1;
            } else if self.passes((kind, camera), frame.stamp) {
                return Some(match kind {
                    CameraKind::Color => DueFrame::Color(frame),
                    CameraKind::Mosaic => DueFrame::Mosaic(frame),
                });
            } else if kind == CameraKind::Color {
                self.counts.skipped_images += 1;
            } else {
                self.counts.skipped_mosaics += 1;
            }
        }
        None
    }

    /// Whether the trigger rule passes an image. The distance is computed from the fixes that have arrived.
    fn passes(&mut self, camera: (CameraKind, usize), stamp: Stamp) -> bool {
        let fixes = self.fixes.make_contiguous();
        let passes =
            self.last_of.get(&camera).is_none_or(|last| self.trigger.is_due(*last, stamp, &Odometer::new(fixes)));
        if passes {
            self.last_of.insert(camera, stamp);
        }
        passes
    }

    /// Ends the recording of images.
    pub(super) fn close(&mut self) {
        self.watch.close();
    }

    /// Counts the images that no sweep takes.
    pub(super) fn discard_rest(&mut self) {
        self.counts.after += self.waiting.len() as u64;
        self.waiting.clear();
    }

    pub(super) fn counts(&self) -> FrameCounts {
        self.counts
    }

    /// Number of images that were recorded of a camera.
    pub(super) fn n_received(&self, kind: CameraKind, camera: usize) -> u64 {
        self.received.get(&(kind, camera)).copied().unwrap_or_default()
    }

    /// Number of images that were recorded.
    pub(super) fn n_recorded(&self) -> u64 {
        self.received.values().sum()
    }

    /// Names and numbers of images since the last call.
    pub(super) fn take_counts(&mut self) -> Vec<(&'static str, u64)> {
        self.counts.files = self.watch.counts();
        let now = self.counts;
        let before = std::mem::replace(&mut self.reported, self.counts);
        vec![
            ("images_recorded", now.files.recorded - before.files.recorded),
            ("strange_files", now.files.strange - before.files.strange),
            ("images_unreadable", now.files.unreadable - before.files.unreadable),
            ("images_left_out", now.files.left_out - before.files.left_out),
            ("frames_before_sweeps", now.before - before.before),
            ("frames_after_sweeps", now.after - before.after),
            ("frames_late", now.late - before.late),
            ("images_skipped_by_trigger", now.skipped_images - before.skipped_images),
            ("mosaics_skipped_by_trigger", now.skipped_mosaics - before.skipped_mosaics),
        ]
    }
}
