//! Finds the scanner position from which each point was measured.

use super::nearest::Memory;
use super::points::CloudPoint;
use super::sweep::difference;
use super::sweeps::{Rule, Sweeps};
use super::{scanner, true_path};
use messages::SubmapPoint;

/// Finds the sweeps of points; caches the look-ups.
#[derive(Default)]
pub(super) struct Finder {
    nearest: Memory,
}

impl Finder {
    /// The sweep of a point and its row in the tile of the sweep; `None` for an invalid point.
    pub fn row(&mut self, point: &CloudPoint, sweeps: &Sweeps) -> Option<(usize, SubmapPoint)> {
        if !point.is_valid() {
            return None;
        }
        let (sweep, offset_nanos) = match &sweeps.rule {
            Rule::Time { bins, shift_nanos } => {
                let sweep = bins.binary_search(&true_path::bin(point.time_s)).ok()?;
                let stamp = true_path::nanos(point.time_s).saturating_add(*shift_nanos);
                (sweep, u32::try_from(stamp.saturating_sub(sweeps.all[sweep].stamp)).ok()?)
            }
            Rule::Nearest(nearest) => (nearest.sweep(point.position, &sweeps.all, &mut self.nearest)?, 0),
        };
        let position = point.scanner.unwrap_or(sweeps.all[sweep].begin);
        let row = scanner::row(difference(point.position, position), point.intensity, point.cosine);
        let tile = sweeps.tile_of(sweep);
        let [x, y, z] = difference(point.position, sweeps.origin_of(tile)).map(|value| value as f32);
        // A tile has at most as many sweeps as a submap.
        let sweep_idx = (sweep - sweeps.tiles[tile].start) as u16;
        Some((sweep, SubmapPoint { x, y, z, offset_nanos, sweep_idx, ..row }))
    }
}
