//! A submap cut into columns of half a metre, each with its extent in height and the ground below it.

use stage::messages::SubmapPoint;
use std::collections::{BTreeMap, BTreeSet};

/// Row (x) and column (y) of a column.
pub(crate) type Key = (i32, i32);

const SIDE_M: f32 = 0.5;
/// Limit of coordinates: points farther away are skipped, so that keys stay within their type.
const MAX_COORDINATE_M: f32 = 1e6;
/// Largest rise of the ground, 15 %, m per column.
const RISE_M: f32 = 0.15 * SIDE_M;
/// Radius in columns of the search for the ground: more than half the width of a truck, 2 m.
const REACH: i32 = 4;
/// Heights at which a wall has returns and the crown of a tree has no returns, m.
const MIDDLE_M: std::ops::Range<f32> = 0.6..2.0;

/// The points above a square of half a metre.
#[derive(Clone, Copy)]
pub(crate) struct Column {
    lowest_m: f32,
    highest_m: f32,
    /// Height of the ground, m.
    pub(crate) ground_m: f32,
    /// Whether there are returns in `MIDDLE_M`.
    pub(crate) has_middle: bool,
}

impl Column {
    /// Height of the highest point above the ground, m.
    pub(crate) fn top_m(&self) -> f32 {
        self.highest_m - self.ground_m
    }
}

/// The columns that have points.
pub(crate) struct ColumnMap(BTreeMap<Key, Column>);

impl ColumnMap {
    pub(crate) fn from_points(points: &[SubmapPoint]) -> Self {
        let mut columns: BTreeMap<Key, Column> = BTreeMap::new();
        for point in points {
            let Some(key) = key_of(point) else { continue };
            let new = Column { lowest_m: point.z, highest_m: point.z, ground_m: point.z, has_middle: false };
            let column = columns.entry(key).or_insert(new);
            column.lowest_m = column.lowest_m.min(point.z);
            column.highest_m = column.highest_m.max(point.z);
        }
        let grounds: Vec<f32> = columns.keys().map(|&key| ground_at(&columns, key)).collect();
        for (column, ground_m) in columns.values_mut().zip(grounds) {
            column.ground_m = ground_m;
        }
        for point in points {
            if let Some(column) = key_of(point).and_then(|key| columns.get_mut(&key)) {
                column.has_middle |= MIDDLE_M.contains(&(point.z - column.ground_m));
            }
        }
        Self(columns)
    }

    pub(crate) fn column_of(&self, point: &SubmapPoint) -> Option<(Key, &Column)> {
        let key = key_of(point)?;
        Some((key, self.0.get(&key)?))
    }

    /// Groups of touching columns that are `inside`.
    pub(crate) fn components(&self, inside: impl Fn(&Column) -> bool) -> Vec<Vec<Key>> {
        let mut open: BTreeSet<Key> = self.0.iter().filter(|(_, c)| inside(c)).map(|(&key, _)| key).collect();
        let mut components = Vec::new();
        while let Some(seed) = open.pop_first() {
            let mut members = vec![seed];
            let mut next = 0;
            while next < members.len() {
                let touching = around(members[next], 1).filter(|key| open.remove(key));
                members.extend(touching.collect::<Vec<_>>());
                next += 1;
            }
            components.push(members);
        }
        components
    }
}

/// x and y of the middle of a column, m.
pub(crate) fn center(key: Key) -> (f32, f32) {
    ((key.0 as f32 + 0.5) * SIDE_M, (key.1 as f32 + 0.5) * SIDE_M)
}

/// The lowest possible ground, from the lowest neighboring points and the steepest slope.
fn ground_at(columns: &BTreeMap<Key, Column>, key: Key) -> f32 {
    let from = |other: Key| {
        let distance = (other.0 - key.0).abs().max((other.1 - key.1).abs());
        columns.get(&other).map(|column| column.lowest_m + RISE_M * distance as f32)
    };
    around(key, REACH).filter_map(from).fold(f32::INFINITY, f32::min)
}

fn around(key: Key, reach: i32) -> impl Iterator<Item = Key> {
    (-reach..=reach).flat_map(move |row| (-reach..=reach).map(move |col| (key.0 + row, key.1 + col)))
}

fn key_of(point: &SubmapPoint) -> Option<Key> {
    let sound = point.x.abs() <= MAX_COORDINATE_M && point.y.abs() <= MAX_COORDINATE_M && point.z.is_finite();
    sound.then(|| ((point.x / SIDE_M).floor() as i32, (point.y / SIDE_M).floor() as i32))
}
