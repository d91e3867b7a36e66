//! Checks whether the drive and the stages provide the columns that a model reads.

use drive::CameraRig;
use messages::{ColorTopic, SpectraTopic};
use segmentation::spherical::{AskedColumns, BAND_REACH_NM};
use stage::{Context, Mode, Problem};
use std::path::Path;

/// The first column of the model `file` that has no source.
pub fn problem(file: &str, path: &Path, context: &Context) -> Option<Problem> {
    let AskedColumns { color, wavelengths_nm } = segmentation::asked_columns(path).ok()?;
    let reads = |what: &str| format!("{file} reads {what}");
    let problem = |text: String| Some(Problem::for_key("model", text));
    let add = "add [colorize] to the launch file, or name a model without cameras";
    if color && !context.is_connected::<ColorTopic>() {
        return problem(format!("{}, and no stage produces topic color; {add}", reads("colors")));
    }
    if !wavelengths_nm.is_empty() && !context.is_connected::<SpectraTopic>() {
        return problem(format!("{}, and no stage produces topic spectra; {add}", reads("spectra")));
    }
    // Other problems of a drive are reported by its source; a replay needs no drive.
    let rig = match context.mode {
        _ if context.drive.as_os_str().is_empty() => return None,
        Mode::Offline => CameraRig::from_drive(&context.drive),
        Mode::Live => CameraRig::from_live(&context.drive),
    };
    let rig = rig.ok()?;
    let drive = context.drive.display();
    if color && rig.cameras().is_empty() {
        return problem(format!("{}, and {drive} has no camera; name a model without colors", reads("colors")));
    }
    let bands_nm = rig.expected_bands().concat();
    let is_near = |nm: u16| bands_nm.iter().any(|band| (band - f32::from(nm)).abs() < BAND_REACH_NM);
    let missing = wavelengths_nm.into_iter().find(|nm| !is_near(*nm))?;
    problem(format!(
        "{}, and {drive} has no camera with a band within {BAND_REACH_NM} nm of it; name a model without this band",
        reads(&format!("the reflectance at {missing} nm"))
    ))
}
