//! `replica evaluate projections`: what range images lose, before any network (thesis figures 6.5 and 6.7).

use super::classes::kitti;
use geometry::{RangeImage, SphericalGrid};
use learning::spherical::back_projection::{BackProjection, NO_CLASS, back_project};
use std::io::Write;
use std::path::PathBuf;

/// Rate of collisions by image size, and accuracy of true labels after projection and back-projection.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder of labelled SemanticKITTI sweeps (*_points_*.npy beside *_labels_*.npy).
    #[arg(long, value_name = "DIR")]
    semantickitti: PathBuf,
}

/// Rows and columns of figure 6.5.
const SIZES: [[usize; 2]; 4] = [[64, 1024], [64, 2048], [128, 1024], [128, 2048]];

/// Methods of figure 6.7.
const METHODS: [(&str, BackProjection); 6] = [
    ("all points", BackProjection::Index),
    ("k 0", BackProjection::Closest),
    ("k 1", BackProjection::Nearest { k: 1 }),
    ("k 3", BackProjection::Nearest { k: 3 }),
    ("k 5", BackProjection::Nearest { k: 5 }),
    ("k 7", BackProjection::Nearest { k: 7 }),
];

/// Runs the command. One row for each size, mean over the sweeps; points outside of the image are left out.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let sweeps = kitti::labelled_sweeps(&args.semantickitti)?;
    let mut out = std::io::stdout().lock();
    let names: Vec<&str> = METHODS.iter().map(|(name, _)| *name).collect();
    writeln!(out, "| size | collisions | {} |", names.join(" | "))?;
    writeln!(out, "|---|---|{}", "---|".repeat(METHODS.len()))?;
    for [rows, columns] in SIZES {
        let grid = SphericalGrid { rows, columns, ..kitti::GRID };
        let (mut collisions, mut right) = (0.0, [0.0; METHODS.len()]);
        for sweep in &sweeps {
            let placed = sweep.points.iter().map(|&[x, y, z]| (grid.pixel([x, y, z]), (x * x + y * y + z * z).sqrt()));
            let image = RangeImage::new(rows, columns, placed);
            collisions += image.collision_rate();
            let shown = |&point: &u32| sweep.ids.get(point as usize).map_or(NO_CLASS, |&id| id as u8);
            let classes: Vec<u8> = image.nearest.iter().map(shown).collect();
            for (sum, (_, method)) in right.iter_mut().zip(METHODS) {
                let said = back_project(&image, &classes, method);
                let inside = (0..said.len()).filter(|&point| image.pixel_of_point[point] != geometry::NO_POINT);
                let labelled: Vec<usize> = inside.filter(|&point| sweep.ids[point] != 0).collect();
                let n_right = labelled.iter().filter(|&&point| u32::from(said[point]) == sweep.ids[point]).count();
                *sum += n_right as f64 / labelled.len().max(1) as f64;
            }
        }
        let mean = |sum: f64| format!("{:.2} %", 100.0 * sum / sweeps.len() as f64);
        let accuracies: Vec<String> = right.into_iter().map(mean).collect();
        writeln!(out, "| {rows} x {columns} | {} | {} |", mean(collisions), accuracies.join(" | "))?;
    }
    Ok(())
}
