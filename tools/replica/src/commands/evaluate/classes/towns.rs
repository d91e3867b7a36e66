//! Simulated towns.

use super::{Args, count};
use crate::commands::train::recipe::town_from_name;
use crate::town_sweeps::{Mount, TownDrive};
use learning::scores::Confusion;
use learning::{Cloud, Segmenter};
use messages::{ClassId, ClassRow};

/// Truth that no model is asked for: thesis section 6.2 leaves out unlabeled, other, dynamic and sky.
const NOT_SCORED: [ClassId; 4] = [ClassId::Unlabeled, ClassId::Other, ClassId::Dynamic, ClassId::Sky];

/// Confusion of each drive.
pub fn confusions(model: &dyn Segmenter, args: &Args) -> anyhow::Result<Vec<(String, Confusion)>> {
    let mut clouds = Vec::new();
    for name in &args.towns {
        let town = town_from_name(name)?;
        for &seed in &args.seeds {
            let drive = TownDrive { town, seed, seconds: args.seconds };
            let mut confusion = Confusion::new(ClassId::ALL.len());
            let (mut n_sweeps, mut seconds, mut score_sum) = (0, 0.0, 0.0);
            for submap in drive.submaps(args.submaps, args.sweeps, 1, Mount::Rig)? {
                let mut classes = vec![ClassRow::default(); submap.points.len()];
                let begin = std::time::Instant::now();
                let cloud = Cloud { header: &submap.header, points: &submap.points, colors: None };
                model.segment(&cloud, &mut classes)?;
                seconds += begin.elapsed().as_secs_f64();
                n_sweeps += args.sweeps;
                score_sum += classes.iter().map(|row| f64::from(row.score) / 255.0).sum::<f64>() / classes.len() as f64;
                let predicted: Vec<u8> = classes.iter().map(|row| row.class_id).collect();
                let is_scored = |class: u8| !NOT_SCORED.iter().any(|not| *not as u8 == class);
                confusion.merge(&count(&submap.truth, &predicted, is_scored));
            }
            eprintln!(
                "{name} {seed}: {:.1} ms per sweep, mean score {:.1} %",
                1e3 * seconds / f64::from(n_sweeps.max(1) as u32),
                100.0 * score_sum / args.submaps.max(1) as f64
            );
            clouds.push((format!("{name}-{seed}"), confusion));
        }
    }
    Ok(clouds)
}
