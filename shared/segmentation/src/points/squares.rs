//! Squares of a cloud in the horizontal plane: regions for the prediction of a network on planes. They overlap less
//! than spheres that cover a street.

use super::cells::is_valid;
use crate::SegmentationError;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Size and overlap of the squares.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SquareSettings {
    /// Side, m.
    pub side_m: f32,
    /// Margin on all four sides that also belongs to neighboring squares, m.
    pub margin_m: f32,
}

/// A region of a cloud that a network processes at a time.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// Center, m. The network receives positions relative to it.
    pub center: [f32; 3],
    /// Numbers of the points.
    pub points: Vec<u32>,
}

impl SquareSettings {
    /// The first violated rule, if any.
    pub fn problem(&self) -> Option<String> {
        // Both are false for NaN.
        if !(1e-3..=1e4).contains(&self.side_m) {
            return Some(format!("side_m = {}; must be 0.001 to 10000", self.side_m));
        }
        let has_core = self.margin_m >= 0.0 && self.margin_m <= 0.4 * self.side_m;
        (!has_core).then(|| format!("margin_m = {}; must be 0 to 0.4 sides", self.margin_m))
    }
    /// The squares of all points, in grid order. The numbers of their points ascend; the points have any height. The
    /// grid starts at 0, so equal positions get equal squares in every cloud. A quarter of the points of a square are
    /// below its center.
    ///
    /// # Errors
    /// If the settings are invalid.
    pub fn squares(&self, points: &[[f32; 3]]) -> Result<Vec<Region>, SegmentationError> {
        self.problem().map_or(Ok(()), |problem| Err(SegmentationError::Settings(problem)))?;
        let side = f64::from(self.side_m);
        let margin = f64::from(self.margin_m);
        let spacing = side - 2.0 * margin;
        let places = |v: f32| {
            let place = |v: f64| (v / spacing).floor() as i64;
            place(f64::from(v) - margin)..=place(f64::from(v) + margin)
        };
        let mut members: BTreeMap<[i64; 2], Vec<u32>> = BTreeMap::new();
        for (point, [x, y, _]) in (0..).zip(points).filter(|(_, position)| is_valid(**position)) {
            for place_x in places(*x) {
                for place_y in places(*y) {
                    members.entry([place_x, place_y]).or_default().push(point);
                }
            }
        }
        let square = |(place, members): ([i64; 2], Vec<u32>)| {
            let [x, y] = place.map(|v| ((v as f64 + 0.5) * spacing) as f32);
            let mut heights: Vec<f32> = members.iter().map(|point| points[*point as usize][2]).collect();
            let quarter = heights.len() / 4;
            let z = *heights.select_nth_unstable_by(quarter, f32::total_cmp).1;
            Region { center: [x, y, z], points: members }
        };
        Ok(members.into_iter().map(square).collect())
    }
}
