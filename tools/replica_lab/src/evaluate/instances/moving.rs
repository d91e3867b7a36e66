//! Scores the mark of moving points, the field `dynamic` of clouds.

use formats::ply::{PlyError, Vertices};
use scores::PointLabel;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// A true object is examined in slots of this length, s: a sweep of most LiDARs.
const SLOT_S: f64 = 0.1;
/// A slot with fewer points has no center.
const MIN_POINTS: u32 = 10;
/// Farther than its largest extent in a slot, m, the center of an object must move: as the LiDAR passes a standing object, its center
/// changes by less than its length.
const MARGIN_M: f64 = 1.0;

/// The mark of the points of all true objects.
#[derive(Default)]
pub struct Moving {
    objects: BTreeMap<u32, TrueObject>,
    /// Marked points without a true object.
    n_marked_elsewhere: u64,
}

#[derive(Default)]
struct TrueObject {
    /// Points by number of their slot since the Unix epoch.
    slots: BTreeMap<i64, Slot>,
    n_points: u64,
    n_marked: u64,
}

/// Points of an object in a slot, horizontal coordinates in m.
struct Slot {
    n: u32,
    sum: [f64; 2],
    min: [f64; 2],
    max: [f64; 2],
}

impl TrueObject {
    /// Whether its center moves farther than a standing object of its size appears to.
    fn moves(&self) -> bool {
        let centers = || self.slots.values().filter(|slot| slot.n >= MIN_POINTS);
        let center = |slot: &Slot| slot.sum.map(|sum| sum / f64::from(slot.n));
        let extent_m = |slot: &Slot| (slot.max[0] - slot.min[0]).hypot(slot.max[1] - slot.min[1]);
        let largest_m = centers().map(extent_m).fold(0.0, f64::max);
        let (Some(first), Some(last)) = (centers().next().map(center), centers().next_back().map(center)) else {
            return false;
        };
        (last[0] - first[0]).hypot(last[1] - first[1]) > largest_m + MARGIN_M
    }
}

/// Shares of marked points.
pub struct MovingScore {
    /// Number of true objects that move.
    pub n_moving: usize,
    /// Their points, and how many of them are marked.
    pub n_points: u64,
    pub n_found: u64,
    /// All marked points.
    pub n_marked: u64,
}

impl MovingScore {
    /// Marked share of the points of moving objects; NaN without such points.
    pub fn recall(&self) -> f64 {
        self.n_found as f64 / self.n_points as f64
    }

    /// Share of the marked points that are on moving objects; NaN without marked points.
    pub fn precision(&self) -> f64 {
        self.n_found as f64 / self.n_marked as f64
    }

    pub fn facts(&self) -> Value {
        json!({"objects": self.n_moving, "points": self.n_points, "marked": self.n_marked, "marked_rightly": self.n_found})
    }

    pub fn text(&self) -> String {
        let [recall, precision] = [self.recall(), self.precision()].map(|share| match share {
            share if share.is_nan() => "-".to_owned(),
            share => format!("{:.2} %", 100.0 * share),
        });
        let Self { n_moving, n_points, n_marked, .. } = self;
        format!(
            "moving: {n_moving} objects with {n_points} points, {recall} of them marked as dynamic; {n_marked} points marked, {precision} of them \
             on moving objects\n"
        )
    }
}

impl Moving {
    /// Adds the points of a cloud with their true labels, where these are known. A cloud without the field `dynamic` is ignored.
    pub fn add(&mut self, cloud: &Vertices, truth: &[Option<PointLabel>]) -> Result<(), PlyError> {
        if !cloud.has("dynamic") {
            return Ok(());
        }
        let marks = cloud.u8s("dynamic")?;
        let [x, y, times] = [cloud.f64s("x")?, cloud.f64s("y")?, cloud.f64s("timestamp")?];
        for (i, label) in truth.iter().enumerate() {
            let Some(label) = label else { continue };
            let marked = u64::from(marks[i] != 0);
            if label.instance == 0 {
                self.n_marked_elsewhere += marked;
                continue;
            }
            let object = self.objects.entry(label.instance).or_default();
            object.n_points += 1;
            object.n_marked += marked;
            let place = [x[i], y[i]];
            let slot = object.slots.entry((times[i] / SLOT_S) as i64).or_insert(Slot {
                n: 0,
                sum: [0.0; 2],
                min: place,
                max: place,
            });
            slot.n += 1;
            for (axis, value) in place.into_iter().enumerate() {
                slot.sum[axis] += value;
                slot.min[axis] = slot.min[axis].min(value);
                slot.max[axis] = slot.max[axis].max(value);
            }
        }
        Ok(())
    }

    pub fn score(&self) -> MovingScore {
        let moving = || self.objects.values().filter(|object| object.moves());
        MovingScore {
            n_moving: moving().count(),
            n_points: moving().map(|object| object.n_points).sum(),
            n_found: moving().map(|object| object.n_marked).sum(),
            n_marked: self.n_marked_elsewhere + self.objects.values().map(|object| object.n_marked).sum::<u64>(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use formats::ply::{Header, Kind, PlyWriter, Row};

    #[test]
    fn passed_object_does_not_move_and_driving_object_does() {
        let path = tempfile::tempdir().expect("a folder");
        let path = path.path().join("cloud.ply");
        let fields = [("x", Kind::Double), ("y", Kind::Double), ("timestamp", Kind::Double), ("dynamic", Kind::UChar)];
        // Object 1 stands, 4 m long, and appears from its front to its rear; object 2 drives at 10 m/s; then ground.
        let mut rows = Vec::new();
        let mut truth = Vec::new();
        for sweep in 0..20_u32 {
            let time = 1000.0 + 0.1 * f64::from(sweep) + 0.05;
            for point in 0..20_u32 {
                let along = 4.0 * f64::from(point) / 19.0;
                if along <= 0.5 * f64::from(sweep) {
                    rows.push(([along, 5.0], time, u8::from(sweep == 3)));
                    truth.push(Some(PointLabel { class: 10, instance: 1 }));
                }
                rows.push(([f64::from(sweep) + along, 9.0], time, u8::from(point < 10)));
                truth.push(Some(PointLabel { class: 10, instance: 2 }));
            }
            rows.push(([0.0; 2], time, 1));
            truth.push(Some(PointLabel { class: 7, instance: 0 }));
            rows.push(([0.0; 2], time, 1));
            truth.push(None);
        }
        let mut writer = PlyWriter::create(&path, &Header::new(fields), rows.len()).expect("creates");
        let encode = |i: usize, row: &mut Row<'_>| {
            let ([x, y], time, mark) = rows[i];
            row.f64(x).f64(y).f64(time).u8(mark);
        };
        writer.write_each(rows.len(), encode).expect("writes");
        writer.finish().expect("finishes");
        let mut moving = Moving::default();
        moving.add(&Vertices::load(&path).expect("reads"), &truth).expect("has the fields");
        let score = moving.score();
        assert_eq!((score.n_moving, score.n_points, score.n_found), (1, 400, 200));
        let n_standing =
            rows.iter().zip(&truth).filter(|(row, label)| row.2 == 1 && label.is_some_and(|l| l.instance == 1));
        assert_eq!(score.n_marked, 200 + 20 + n_standing.count() as u64);
        assert!(score.text().contains("1 objects with 400 points, 50.00 % of them marked"), "{}", score.text());
    }
}
