//! Whether the clouds of a recorded drive fit the disk: found out before a run of hours.

use crate::Settings;
use delivery::{CloudFields, space_need};
use drive::Drive;
use messages::{ClassTopic, ColorTopic, InstanceTopic, MaterialTopic, RegionTopic, SpectraTopic};
use stage::space::{bytes_of_files, free_bytes, size_text};
use stage::{Context, Mode, Problem};

/// A start is refused with less than this share of the estimated space: estimates err, and space may be freed during the run.
const MIN_SHARE: f64 = 0.6;

/// A problem if the clouds will not fit. A drive that cannot be read is reported by its source.
pub(crate) fn lacks(settings: &Settings, context: &Context) -> Option<Problem> {
    if context.mode == Mode::Live || settings.formats.is_empty() {
        return None;
    }
    let further: Vec<&str> = settings.further_classes.iter().map(String::as_str).collect();
    let fields = CloudFields {
        coordinates: settings.coordinates.kind(),
        has_lidars: false,
        has_instance: context.is_connected::<InstanceTopic>(),
        has_class: context.is_connected::<ClassTopic>(),
        has_color: context.is_connected::<ColorTopic>(),
        has_material: context.is_connected::<MaterialTopic>(),
        has_region: context.is_connected::<RegionTopic>(),
        further_classes: &further,
    };
    let has_spectra = settings.spectra && context.is_connected::<SpectraTopic>();
    let need = space_need(&Drive::open(&context.drive).ok()?, fields, has_spectra).ok()?;
    // Clouds that are there are continued or replaced.
    let free = free_bytes(&context.output)? + bytes_of_files(&context.output.join("clouds"));
    let is_too_small = (free as f64) < MIN_SHARE * need.bytes as f64;
    let text = || {
        format!(
            "{}: {} free, but the clouds of about {:.1} million points need about {}; make room, or set another run.output",
            context.output.display(),
            size_text(free),
            need.points as f64 * 1e-6,
            size_text(need.bytes)
        )
    };
    is_too_small.then(|| Problem::of_key("", text()))
}
