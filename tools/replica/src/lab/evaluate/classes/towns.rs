//! Evaluates a model on simulated towns.

use super::Args;
use super::error_picture;
use super::point_confusion::point_confusion;
use super::reliability::Reliability;
use messages::{ClassId, ClassRow};
use scores::Confusion;
use segmentation::{ModelInput, Segmenter};
use town_sweeps::{Mount, TownDrive, town_from_name};

/// True classes that are not scored: thesis section 6.2 leaves out unlabeled, other, dynamic and sky.
const NOT_SCORED: [ClassId; 4] = [ClassId::Unlabeled, ClassId::Other, ClassId::Dynamic, ClassId::Sky];

/// The confusion matrix of each drive.
pub fn confusions(model: &dyn Segmenter, args: &Args) -> anyhow::Result<Vec<(String, Confusion)>> {
    let (mut clouds, mut pooled) = (Vec::new(), Reliability::default());
    let mut picture = args.picture.as_deref();
    for name in &args.towns {
        let town = town_from_name(name)?;
        for &seed in &args.seeds {
            let drive = TownDrive { town, seed, seconds: args.seconds };
            let mut confusion = Confusion::new(ClassId::ALL.len());
            let (mut n_sweeps, mut seconds, mut reliability) = (0, 0.0, Reliability::default());
            for mut submap in drive.submaps(args.submaps, args.sweeps, 1, Mount::Rig)? {
                for point in &mut submap.points {
                    point.intensity = (f32::from(point.intensity) * args.gain).round() as u8;
                }
                let mut classes = vec![ClassRow::default(); submap.points.len()];
                let begin = std::time::Instant::now();
                let cloud = ModelInput::new(&submap.header, &submap.points);
                model.segment(&cloud, &mut classes)?;
                seconds += begin.elapsed().as_secs_f64();
                n_sweeps += args.sweeps;
                let predicted: Vec<u8> = classes.iter().map(|row| row.class_id).collect();
                if let Some(path) = picture.take() {
                    error_picture::write(path, &submap.points, &submap.truth, &predicted)?;
                }
                let is_scored = |class: u8| !NOT_SCORED.iter().any(|not| *not as u8 == class);
                for (row, truth) in classes.iter().zip(&submap.truth).filter(|(_, truth)| is_scored(**truth)) {
                    reliability.add(f64::from(row.score) / 255.0, row.class_id == *truth);
                }
                confusion.merge(&point_confusion(&submap.truth, &predicted, is_scored));
            }
            eprintln!(
                "{name} {seed}: {:.1} ms per sweep, expected calibration error {:.1} %",
                1e3 * seconds / f64::from(n_sweeps.max(1) as u32),
                100.0 * reliability.calibration_error()
            );
            pooled.merge(&reliability);
            clouds.push((format!("{name}-{seed}"), confusion));
        }
    }
    if !clouds.is_empty() {
        eprint!("{pooled}");
    }
    Ok(clouds)
}
