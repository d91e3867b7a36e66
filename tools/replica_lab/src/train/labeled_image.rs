//! Sweeps of labeled submaps as images.

use super::intensity_scale::IntensityScale;
use super::removed_classes::RemovedClasses;
use super::sources::Labeled;
use geometry::NO_POINT;
use messages::{ClassId, ClassRow};
use segmentation::spherical::{GroundUse, ImageSource, PolarImage, RangeSweep, Settings};
use training::UNKNOWN;

/// A sweep as an image, with the output number of the class of each pixel, [`UNKNOWN`] without a class.
pub struct LabeledImage {
    pub image: PolarImage,
    pub truth: Vec<u8>,
}

/// The sweeps of a submap as images, without the points of removed classes.
pub fn images_of(
    Labeled { input: cloud, classes }: &Labeled<'_>,
    settings: &Settings,
    removed_classes: &RemovedClasses,
    scale: IntensityScale,
) -> Vec<LabeledImage> {
    let ground = cloud.ground();
    let heights_m = ground.heights(cloud.points);
    let removed = (settings.ground == GroundUse::Removed).then(|| {
        let is_ground = |row: &ClassRow| row.class_id != ClassId::Unlabeled as u8;
        ground.classes(&heights_m).iter().map(is_ground).collect::<Vec<bool>>()
    });
    let removed = removed_classes.with_points(removed, classes);
    let output = output_of_class(settings);
    let intensities = scale.map(cloud.points, &heights_m);
    let of_sweep = |mut sweep: RangeSweep| {
        sweep.polar.apply_intensities(&intensities);
        let class = |&shown: &u32| match shown {
            NO_POINT => UNKNOWN,
            point => output[usize::from(classes[sweep.points.start + point as usize])],
        };
        let truth: Vec<u8> = sweep.image.nearest.iter().map(class).collect();
        LabeledImage { image: sweep.polar, truth }
    };
    let bands = settings.features.camera_bands();
    let source = ImageSource::new(cloud, settings.columns, &heights_m).without(removed.as_deref()).with_camera(&bands);
    source.sweeps().into_iter().map(of_sweep).collect()
}

/// Output number of a class; `None` for classes that the network does not distinguish.
pub fn output_of(class: ClassId, settings: &Settings) -> Option<u8> {
    settings.classes.iter().position(|name| name == class.name()).map(|output| output as u8)
}

/// Output numbers by class id; [`UNKNOWN`] for classes that the network does not distinguish.
fn output_of_class(settings: &Settings) -> Vec<u8> {
    ClassId::ALL.iter().map(|class| output_of(*class, settings).unwrap_or(UNKNOWN)).collect()
}
