//! The labelled returns of one sweep, and the search for the return of a point of a cloud.

use lidar::{SweepInfo, SweepPoint};

/// Tolerance of times: a time stored as f64 seconds is rounded to 0.24 µs, and a laser fires every 46 µs.
const TOLERANCE_NANOS: i64 = 500;
/// Tolerance of ranges: 1 cm of the stored range, and coordinates in f32 within 100 km of their origin.
const TOLERANCE_M: f32 = 0.03;
/// Relative tolerance of ranges: the scale of UTM is up to 0.1 % off at the edge of a zone.
const TOLERANCE_SHARE: f32 = 0.001;

/// Class and instance of a return.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TrueLabel {
    /// Class id of the class table.
    pub class: u8,
    /// Instance, 0 = none.
    pub instance: u16,
}

/// Known properties of the return from which a point of a cloud was made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shot {
    /// Time of the shot, ns since the Unix epoch.
    pub stamp: i64,
    /// Ring.
    pub ring: u8,
    /// Encoder angle, 0.01 deg. Needed for recordings without point times, whose shots are distinguished by ring and angle.
    pub azimuth: Option<u16>,
    /// Distance from the LiDAR, m. A return at another distance does not belong to the point.
    pub range_m: Option<f32>,
}

/// Reason why a point has no label.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoLabel {
    /// The drive has no sweep at this time.
    NoSweep,
    /// The sweep has no return of this ring at this time (or, without point times, at this angle).
    NoReturn,
    /// The return of this shot has another angle or range: the point is of another drive.
    OtherReturn,
    /// The point is a return of a sweep without labels.
    UnlabeledSweep,
}

/// Returns of one sweep and their labels, if it has any. Memory: 12 bytes per return.
#[derive(Clone, Debug)]
pub struct LabelledSweep {
    stamp: i64,
    duration_nanos: i64,
    has_times: bool,
    has_labels: bool,
    /// Sorted by ring, then time, then azimuth.
    returns: Vec<Labelled>,
}

#[derive(Clone, Copy, Debug)]
struct Labelled {
    offset_nanos: u32,
    azimuth: u16,
    range_cm: u16,
    instance: u16,
    ring: u8,
    class: u8,
}

impl Labelled {
    fn new(point: &SweepPoint, label: TrueLabel) -> Self {
        let range_m = (point.x * point.x + point.y * point.y + point.z * point.z).sqrt();
        let TrueLabel { class, instance } = label;
        let SweepPoint { offset_nanos, azimuth, ring, .. } = *point;
        // Saturates at 655 m, beyond the maximum range of all models.
        Self { offset_nanos, azimuth, range_cm: (range_m * 100.0).round() as u16, instance, ring, class }
    }

    fn label(&self) -> TrueLabel {
        TrueLabel { class: self.class, instance: self.instance }
    }

    /// Difference of the ranges, m, or `None` if it is large enough to indicate another return. 0 for a shot without range.
    fn range_error(&self, shot: &Shot) -> Option<f32> {
        let Some(range_m) = shot.range_m else { return Some(0.0) };
        let error_m = (f32::from(self.range_cm) * 0.01 - range_m).abs();
        (error_m <= TOLERANCE_M + TOLERANCE_SHARE * range_m).then_some(error_m)
    }
}

impl LabelledSweep {
    /// The labelled returns of a sweep. `labels` has as many items as `points`.
    pub(super) fn new(sweep: &SweepInfo, points: &[SweepPoint], labels: impl Iterator<Item = TrueLabel>) -> Self {
        let mut returns: Vec<Labelled> =
            points.iter().zip(labels).map(|(point, label)| Labelled::new(point, label)).collect();
        returns.sort_by_key(|r| (r.ring, r.offset_nanos, r.azimuth));
        let SweepInfo { stamp, duration_nanos, has_times, .. } = *sweep;
        Self { stamp: stamp.0, duration_nanos: i64::from(duration_nanos), has_times, has_labels: true, returns }
    }

    /// The returns of a sweep that has no labels.
    pub(super) fn unlabeled(sweep: &SweepInfo, points: &[SweepPoint]) -> Self {
        let none = std::iter::repeat(TrueLabel { class: 0, instance: 0 });
        Self { has_labels: false, ..Self::new(sweep, points, none) }
    }

    /// Whether the sweep has labels.
    pub fn has_labels(&self) -> bool {
        self.has_labels
    }

    /// Time of the first shot, ns since the Unix epoch.
    pub fn stamp(&self) -> i64 {
        self.stamp
    }

    /// Number of returns.
    pub fn n_returns(&self) -> usize {
        self.returns.len()
    }

    /// Whether the sweep begins at or before a time.
    pub(super) fn begins_before(&self, stamp: i64) -> bool {
        self.stamp <= stamp.saturating_add(TOLERANCE_NANOS)
    }

    /// Time of the first shot of the next sweep, ns since the Unix epoch.
    pub fn end(&self) -> i64 {
        self.stamp.saturating_add(self.duration_nanos)
    }

    /// The label of a return.
    pub fn find(&self, shot: &Shot) -> Result<TrueLabel, NoLabel> {
        if !self.begins_before(shot.stamp) || self.end() < shot.stamp.saturating_sub(TOLERANCE_NANOS) {
            return Err(NoLabel::NoSweep);
        }
        let candidates = if self.has_times { self.at_time(shot) } else { self.at_azimuth(shot)? };
        if candidates.is_empty() {
            return Err(NoLabel::NoReturn);
        }
        let is_of_shot = |r: &&Labelled| shot.azimuth.is_none_or(|azimuth| r.azimuth == azimuth);
        let found = candidates.iter().filter(is_of_shot).filter_map(|r| Some((r.range_error(shot)?, r)));
        // Of two echoes with equal range errors, the first is used.
        let nearest = found.min_by(|a, b| a.0.total_cmp(&b.0));
        let (_, found) = nearest.ok_or(NoLabel::OtherReturn)?;
        if self.has_labels { Ok(found.label()) } else { Err(NoLabel::UnlabeledSweep) }
    }

    /// The returns of the ring at the time of the shot.
    fn at_time(&self, shot: &Shot) -> &[Labelled] {
        let offset = shot.stamp.saturating_sub(self.stamp);
        let key = |r: &Labelled| (r.ring, i64::from(r.offset_nanos));
        let first = self.returns.partition_point(|r| key(r) < (shot.ring, offset - TOLERANCE_NANOS));
        let end = self.returns.partition_point(|r| key(r) <= (shot.ring, offset + TOLERANCE_NANOS));
        &self.returns[first..end.max(first)]
    }

    /// The returns of the ring at the angle of the shot: without point times, all returns have the time of the sweep.
    fn at_azimuth(&self, shot: &Shot) -> Result<&[Labelled], NoLabel> {
        let azimuth = shot.azimuth.ok_or(NoLabel::NoReturn)?;
        let first = self.returns.partition_point(|r| (r.ring, r.azimuth) < (shot.ring, azimuth));
        let end = self.returns.partition_point(|r| (r.ring, r.azimuth) <= (shot.ring, azimuth));
        Ok(&self.returns[first..end])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Stamp;

    fn point(ring: u8, offset_nanos: u32, azimuth: u16, range_m: f32) -> SweepPoint {
        SweepPoint { x: range_m, ring, offset_nanos, azimuth, ..SweepPoint::default() }
    }

    /// Labels are the indexes of the points.
    fn sweep(has_times: bool, points: &[SweepPoint]) -> LabelledSweep {
        let info = SweepInfo {
            seq: 0,
            stamp: Stamp(1_000_000_000),
            duration_nanos: 100_000_000,
            n_returns: points.len(),
            lost_packets: 0,
            turn: 1.0,
            has_times,
        };
        let label = |instance: usize| TrueLabel { class: 7, instance: instance as u16 };
        LabelledSweep::new(&info, points, (0..points.len()).map(label))
    }

    fn shot(offset_nanos: i64, ring: u8, azimuth: u16, range_m: f32) -> Shot {
        Shot { stamp: 1_000_000_000 + offset_nanos, ring, azimuth: Some(azimuth), range_m: Some(range_m) }
    }

    #[test]
    fn echoes_of_one_shot_are_told_apart_by_their_ranges() {
        let sweep = sweep(true, &[point(3, 46_000, 100, 9.0), point(3, 46_000, 100, 30.0), point(4, 46_000, 100, 9.0)]);
        let instance = |shot: Shot| sweep.find(&shot).map(|label| label.instance);
        assert_eq!(instance(shot(46_200, 3, 100, 9.02)), Ok(0));
        assert_eq!(instance(shot(45_900, 3, 100, 29.97)), Ok(1));
        assert_eq!(instance(shot(46_000, 4, 100, 9.0)), Ok(2));
        assert_eq!(instance(shot(46_000, 3, 100, 15.0)), Err(NoLabel::OtherReturn));
        assert_eq!(instance(shot(46_000, 3, 101, 9.0)), Err(NoLabel::OtherReturn));
        assert_eq!(instance(shot(47_000, 3, 100, 9.0)), Err(NoLabel::NoReturn));
        assert_eq!(instance(shot(46_000, 5, 100, 9.0)), Err(NoLabel::NoReturn));
        assert_eq!(instance(shot(200_000_000, 3, 100, 9.0)), Err(NoLabel::NoSweep));
        // A caller with only time and ring gets the first echo.
        let bare = Shot { azimuth: None, range_m: None, ..shot(46_000, 3, 0, 0.0) };
        assert_eq!(instance(bare), Ok(0));
    }

    #[test]
    fn returns_without_times_are_found_by_ring_and_angle() {
        let sweep = sweep(false, &[point(3, 0, 200, 9.0), point(3, 0, 100, 9.0), point(3, 0, 100, 30.0)]);
        let instance = |shot: Shot| sweep.find(&shot).map(|label| label.instance);
        // The odometry may have assigned times to them.
        for offset_nanos in [0, 55_000_000] {
            assert_eq!(instance(shot(offset_nanos, 3, 200, 9.0)), Ok(0));
            assert_eq!(instance(shot(offset_nanos, 3, 100, 9.0)), Ok(1));
            assert_eq!(instance(shot(offset_nanos, 3, 100, 30.0)), Ok(2));
        }
        assert_eq!(instance(shot(0, 3, 150, 9.0)), Err(NoLabel::NoReturn));
        assert_eq!(instance(Shot { azimuth: None, ..shot(0, 3, 200, 9.0) }), Err(NoLabel::NoReturn));
        assert_eq!(instance(shot(0, 3, 200, 9.2)), Err(NoLabel::OtherReturn));
    }
}
