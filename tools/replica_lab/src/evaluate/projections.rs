//! `replica-lab evaluate projections`: information that range images lose (thesis figures 6.5 and 6.7).

use super::classes::semantic_kitti::{self, LabelledSweep};
use anyhow::Context;
use chart::{Axis, COLORS, Chart, Series};
use command_line::answer::Answer;
use geometry::{RangeImage, SphericalGrid};
use segmentation::spherical::back_projection::{BackProjection, NO_CLASS, back_project};
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use town_sweeps::{Mount, TownDrive, town_from_name};

/// Score range images: collision rate by image size, accuracy by method of back-projection.
#[derive(Debug, clap::Args)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage\n\n\
                  Example: replica-lab evaluate projections --seeds 901")]
pub struct Args {
    /// Folder of labelled SemanticKITTI sweeps, all of which are read: velodyne/*.bin and labels/*.label, or pairs
    /// *_points_*.npy and *_labels_*.npy
    #[arg(long, value_name = "DIR", required_unless_present = "seeds")]
    semantickitti: Option<PathBuf>,
    /// Kind of simulated town; the lidar is an HDL-64E mounted as KITTI's
    #[arg(long, requires = "seeds", default_value = "urban")]
    town: String,
    /// Seeds of the simulated drives; each is 20 s long and provides five sweeps
    #[arg(long, value_delimiter = ',')]
    seeds: Vec<u64>,
    /// Draw both figures of each set of sweeps into this SVG
    #[arg(long, value_name = "SVG")]
    picture: Option<PathBuf>,
    #[command(flatten)]
    answer: Answer,
}

/// Image sizes of figure 6.5: rows and columns.
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

/// Losses of images of one size: means over the sweeps, 0 to 1.
struct Losses {
    size: String,
    collisions: f64,
    /// Accuracy by method, over labelled points in the image.
    accuracies: [f64; METHODS.len()],
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let mut sets = Vec::new();
    if let Some(folder) = &args.semantickitti {
        sets.push(("SemanticKITTI".to_owned(), semantic_kitti::labelled_sweeps(folder)?));
    }
    if !args.seeds.is_empty() {
        sets.push((format!("Simulated town, {}", args.town), town_sweeps(args)?));
    }
    let mut charts = Vec::new();
    let mut text = String::new();
    let mut facts = Vec::new();
    for (name, sweeps) in &sets {
        let losses: Vec<Losses> = SIZES.iter().map(|size| Losses::measure(*size, sweeps)).collect();
        text += &table(&format!("{name}, {} sweeps", sweeps.len()), &losses);
        facts.push(json!({"name": name, "sweeps": sweeps.len(), "sizes": facts_of(&losses)}));
        charts.extend(figures(name, &losses));
    }
    args.answer.print(&json!({ "sets": facts }), || text)?;
    if let Some(path) = &args.picture {
        std::fs::write(path, chart::sheet(&charts, 2)).with_context(|| path.display().to_string())?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Sweeps in the frame of the lidar at the start of the sweep, as in KITTI.
fn town_sweeps(args: &Args) -> anyhow::Result<Vec<LabelledSweep>> {
    let town = town_from_name(&args.town)?;
    let mut sweeps = Vec::new();
    for &seed in &args.seeds {
        for submap in (TownDrive { town, seed, seconds: 20.0 }).submaps(5, 1, 1, Mount::KITTI)? {
            let [x, y, z, ..] = submap.header.sweeps[0].submap_from_lidar_begin;
            let points = submap.points.iter().map(|point| [point.x - x, point.y - y, point.z - z]).collect();
            let intensities = submap.points.iter().map(|point| point.intensity).collect();
            let ids = submap.truth.iter().map(|&class| u32::from(class)).collect();
            sweeps.push(LabelledSweep { points, intensities, ids });
        }
    }
    Ok(sweeps)
}

impl Losses {
    fn measure([rows, columns]: [usize; 2], sweeps: &[LabelledSweep]) -> Self {
        let grid = SphericalGrid { rows, columns, ..semantic_kitti::GRID };
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
                let predicted = back_project(&image, &classes, method);
                let inside = (0..predicted.len()).filter(|&point| image.pixel_of_point[point] != geometry::NO_POINT);
                let labelled: Vec<usize> = inside.filter(|&point| sweep.ids[point] != 0).collect();
                let n_correct =
                    labelled.iter().filter(|&&point| u32::from(predicted[point]) == sweep.ids[point]).count();
                *accuracy += share * n_correct as f64 / labelled.len().max(1) as f64;
            }
        }
        losses
    }
}

/// An object per size, with shares from 0 to 1.
fn facts_of(losses: &[Losses]) -> Value {
    let of_size = |Losses { size, collisions, accuracies }: &Losses| {
        let by_method: serde_json::Map<String, Value> =
            METHODS.iter().zip(accuracies).map(|((name, _), share)| ((*name).to_owned(), json!(share))).collect();
        json!({"size": size, "collisions": collisions, "accuracy": by_method})
    };
    losses.iter().map(of_size).collect()
}

fn table(title: &str, losses: &[Losses]) -> String {
    let names: Vec<&str> = METHODS.iter().map(|(name, _)| *name).collect();
    let mut text = format!("### {title}\n\n| size | collisions | {} |\n", names.join(" | "));
    // Writing to a string cannot fail.
    let _ = writeln!(text, "|---|---|{}", "---|".repeat(METHODS.len()));
    let percent = |share: f64| format!("{:.2} %", 100.0 * share);
    for Losses { size, collisions, accuracies } in losses {
        let _ = writeln!(text, "| {size} | {} | {} |", percent(*collisions), accuracies.map(percent).join(" | "));
    }
    text + "\n"
}

/// Figures 6.5 and 6.7, with one color per size.
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
                percent("points in an occupied pixel, %"),
                collisions.collect(),
            ),
        ),
        sized(
            560.0,
            Chart::new(
                format!("{name}: back-projection of the true classes"),
                of_methods_x,
                percent("correct points, %"),
                of_methods.collect(),
            ),
        ),
    ]
}
