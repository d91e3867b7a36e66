//! `replica evaluate projections`: what range images lose, before any network (thesis figures 6.5 and 6.7).

use super::classes::kitti::{self, LabelledSweep};
use crate::commands::train::recipe::town_from_name;
use anyhow::Context;
use chart::{Axis, COLORS, Chart, Series};
use geometry::{RangeImage, SphericalGrid};
use learning::spherical::back_projection::{BackProjection, NO_CLASS, back_project};
use replica::town_sweeps::{Mount, TownDrive};
use std::io::Write;
use std::path::PathBuf;

/// Rate of collisions by image size, and accuracy of true labels after projection and back-projection.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder of labelled SemanticKITTI sweeps (*_points_*.npy beside *_labels_*.npy).
    #[arg(long, value_name = "DIR", required_unless_present = "seeds")]
    semantickitti: Option<PathBuf>,
    /// Kind of simulated town for an HDL-64E mounted as KITTI's.
    #[arg(long, requires = "seeds", default_value = "urban")]
    town: String,
    /// Seeds of the drives through it, of 20 s, with five sweeps of each.
    #[arg(long, value_delimiter = ',')]
    seeds: Vec<u64>,
    /// Draws both figures of every set of sweeps into this SVG.
    #[arg(long, value_name = "SVG")]
    picture: Option<PathBuf>,
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

/// What images of one size do to some sweeps: means, shares of 1.
struct Losses {
    size: String,
    collisions: f64,
    /// By method; of labelled points in the image.
    accuracies: [f64; METHODS.len()],
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let mut sets = Vec::new();
    if let Some(folder) = &args.semantickitti {
        sets.push(("SemanticKITTI".to_owned(), kitti::labelled_sweeps(folder)?));
    }
    if !args.seeds.is_empty() {
        sets.push((format!("Simulated town, {}", args.town), town_sweeps(args)?));
    }
    let mut charts = Vec::new();
    for (name, sweeps) in &sets {
        let losses: Vec<Losses> = SIZES.iter().map(|size| Losses::of(*size, sweeps)).collect();
        write_table(&format!("{name}, {} sweeps", sweeps.len()), &losses)?;
        charts.extend(figures(name, &losses));
    }
    if let Some(path) = &args.picture {
        std::fs::write(path, chart::sheet(&charts, 2)).with_context(|| path.display().to_string())?;
    }
    Ok(())
}

/// In the sensor's frame at the begin of each sweep, as KITTI has them.
fn town_sweeps(args: &Args) -> anyhow::Result<Vec<LabelledSweep>> {
    let town = town_from_name(&args.town)?;
    let mut sweeps = Vec::new();
    for &seed in &args.seeds {
        for submap in (TownDrive { town, seed, seconds: 20.0 }).submaps(5, 1, 1, Mount::Kitti)? {
            let [x, y, z, ..] = submap.header.sweeps[0].submap_from_lidar_begin;
            let points = submap.points.iter().map(|point| [point.x - x, point.y - y, point.z - z]).collect();
            let ids = submap.truth.iter().map(|&class| u32::from(class)).collect();
            sweeps.push(LabelledSweep { name: format!("{town:?} {seed}"), points, ids });
        }
    }
    Ok(sweeps)
}

impl Losses {
    fn of([rows, columns]: [usize; 2], sweeps: &[LabelledSweep]) -> Self {
        let grid = SphericalGrid { rows, columns, ..kitti::GRID };
        let share = 1.0 / sweeps.len() as f64;
        let mut losses =
            Self { size: format!("{rows} x {columns}"), collisions: 0.0, accuracies: [0.0; METHODS.len()] };
        for sweep in sweeps {
            let placed = sweep.points.iter().map(|&[x, y, z]| (grid.pixel([x, y, z]), (x * x + y * y + z * z).sqrt()));
            let image = RangeImage::new(rows, columns, placed);
            losses.collisions += share * image.collision_rate();
            let shown = |&point: &u32| sweep.ids.get(point as usize).map_or(NO_CLASS, |&id| id as u8);
            let classes: Vec<u8> = image.nearest.iter().map(shown).collect();
            for (accuracy, (_, method)) in losses.accuracies.iter_mut().zip(METHODS) {
                let said = back_project(&image, &classes, method);
                let inside = (0..said.len()).filter(|&point| image.pixel_of_point[point] != geometry::NO_POINT);
                let labelled: Vec<usize> = inside.filter(|&point| sweep.ids[point] != 0).collect();
                let n_right = labelled.iter().filter(|&&point| u32::from(said[point]) == sweep.ids[point]).count();
                *accuracy += share * n_right as f64 / labelled.len().max(1) as f64;
            }
        }
        losses
    }
}

fn write_table(title: &str, losses: &[Losses]) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    let names: Vec<&str> = METHODS.iter().map(|(name, _)| *name).collect();
    writeln!(out, "### {title}\n\n| size | collisions | {} |", names.join(" | "))?;
    writeln!(out, "|---|---|{}", "---|".repeat(METHODS.len()))?;
    let percent = |share: f64| format!("{:.2} %", 100.0 * share);
    for Losses { size, collisions, accuracies } in losses {
        writeln!(out, "| {size} | {} | {} |", percent(*collisions), accuracies.map(percent).join(" | "))?;
    }
    Ok(writeln!(out)?)
}

/// Figures 6.5 and 6.7; a color for each size.
fn figures(name: &str, losses: &[Losses]) -> [Chart; 2] {
    let bars = |i: usize, points| Series::bars(&losses[i].size, COLORS[i], points, 0.2);
    let sizes = 0..losses.len();
    let x_of = |i: usize| 0.2 * (i as f64 - 0.5 * (losses.len() - 1) as f64);
    let collisions = sizes.clone().map(|i| bars(i, vec![[x_of(i), 100.0 * losses[i].collisions]]));
    let of_methods = sizes.map(|i| {
        let percents = (0_u32..).zip(losses[i].accuracies);
        bars(i, percents.map(|(method, share)| [f64::from(method) + x_of(i), 100.0 * share]).collect())
    });
    let methods = format!("from the left: {}", METHODS.map(|(name, _)| name).join(", "));
    let of_methods_x = Axis::without_numbers(methods, [-0.6, METHODS.len() as f64 - 0.4]);
    let percent = |label: &str| Axis::new(label, [0.0, 100.0]);
    let sized = |width: f64, chart: Chart| Chart { size: [width, 240.0], ..chart };
    [
        sized(
            440.0,
            Chart::new(
                format!("{name}: collisions"),
                Axis::without_numbers("size of the image", [-0.6, 0.6]),
                percent("points in a pixel that is taken, %"),
                collisions.collect(),
            ),
        ),
        sized(
            560.0,
            Chart::new(
                format!("{name}: back-projection of the true classes"),
                of_methods_x,
                percent("right points, %"),
                of_methods.collect(),
            ),
        ),
    ]
}
