//! Color and mosaic cameras: stamps of all files, and a few decoded images.

use super::pictures;
use super::stream::Stream;
use super::{DriveReport, Reading};
use acquisition::recorded::{CameraFileError, image_into, mosaic_into};
use drive::manifest::{CameraEntry, MosaicEntry};
use drive::{Drive, Frame};
use std::ops::RangeInclusive;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};

/// Mean brightness, as a share of white, outside of which an image is black or white.
const BRIGHTNESS: RangeInclusive<f64> = 0.03..=0.97;
/// Mean brightness of the linear samples of a mosaic, as [`BRIGHTNESS`]: a street has a few percent at short exposures, including
/// the dark level of the sensor.
const MOSAIC_BRIGHTNESS: RangeInclusive<f64> = 0.005..=0.97;
/// Largest number of damaged images of a camera that are reported one by one.
const MAX_REPORTED: usize = 5;

/// Adds streams, facts, doubts and the first picture of each camera.
pub fn add(drive: &Drive, reading: Reading, report: &mut DriveReport) {
    if let Some(path) = drive.strange_files().first() {
        let n = drive.strange_files().len();
        report.doubt(format!("{n} files in camera folders have no stamp as name, the first: {}", path.display()));
    }
    let manifest = drive.manifest();
    let mut lines = Vec::new();
    for (index, entry) in manifest.cameras.iter().enumerate() {
        let name = format!("camera {index} ({})", entry.name);
        let (width, height) = entry.model.size();
        let camera = Camera { name, kind: format!("{width} x {height}"), folder: &entry.folder, sound: BRIGHTNESS };
        let load = |frame: &Frame| color(frame, entry);
        lines.extend(camera.add(&camera_frames(drive.camera_frames(), index), reading, load, report));
    }
    for (index, entry) in manifest.mosaics.iter().enumerate() {
        let name = format!("mosaic {index} ({})", entry.name);
        let kind = format!("{0} x {0} bands", entry.pattern);
        let camera = Camera { name, kind, folder: &entry.folder, sound: MOSAIC_BRIGHTNESS };
        let load = |frame: &Frame| mosaic(frame, entry);
        lines.extend(camera.add(&camera_frames(drive.mosaic_frames(), index), reading, load, report));
        for reference in ["dark", "white"] {
            let folder = drive.folder().join(&entry.folder).join(reference);
            if folder.read_dir().is_ok_and(|mut files| files.next().is_some()) {
                continue;
            }
            report.doubt(format!("mosaic {index} ({}): no {reference} frames in {}", entry.name, folder.display()));
        }
    }
    if manifest.cameras.is_empty() && manifest.mosaics.is_empty() {
        lines.push("none".to_owned());
    }
    report.section("Cameras", lines);
}

fn camera_frames(frames: &[Frame], index: usize) -> Vec<&Frame> {
    frames.iter().filter(|frame| frame.camera == index).collect()
}

/// A decoded image: RGB pixels and their mean brightness, 0 to 1.
struct Decoded {
    rgb: image::RgbImage,
    brightness: f64,
}

struct Camera<'a> {
    name: String,
    kind: String,
    folder: &'a str,
    /// Mean brightness of a valid image.
    sound: RangeInclusive<f64>,
}

impl Camera<'_> {
    fn add(
        &self,
        frames: &[&Frame],
        reading: Reading,
        load: impl Fn(&Frame) -> Result<Decoded, CameraFileError>,
        report: &mut DriveReport,
    ) -> Option<String> {
        let sizes = frames.iter().map(|frame| frame.path.metadata().map_or(0, |metadata| metadata.len()));
        let stamps = frames.iter().map(|frame| frame.stamp.0).collect();
        let stream = Stream::new(&self.name, &self.kind, stamps).with_files(frames.len(), sizes.sum());
        report.streams.push(stream);
        let (Some(first), n) = (frames.first(), frames.len()) else {
            report.doubt(format!("{}: no image in folder {}", self.name, self.folder));
            return None;
        };
        let mut chosen: Vec<usize> = match reading {
            Reading::Stamps => return None,
            Reading::Samples => vec![0, n / 2, n - 1],
            Reading::All => (0..n).collect(),
        };
        chosen.dedup();
        let mut brightness = Vec::new();
        let mut n_bad = 0;
        for index in &chosen {
            match load(frames[*index]) {
                Ok(decoded) => {
                    if !self.sound.contains(&decoded.brightness) && brightness.iter().all(|b| self.sound.contains(b)) {
                        let share = 100.0 * decoded.brightness;
                        let path = frames[*index].path.display();
                        report.doubt(format!("{}: {path} has a mean brightness of {share:.1} %", self.name));
                    }
                    brightness.push(decoded.brightness);
                    if std::ptr::eq(frames[*index], *first) {
                        report.pictures.extend(pictures::small(&self.name, &decoded.rgb));
                    }
                }
                Err(error) => {
                    n_bad += 1;
                    if n_bad <= MAX_REPORTED {
                        report.doubt(error.to_string());
                    }
                }
            }
        }
        let shown: Vec<String> = if reading == Reading::All {
            let mean = brightness.iter().sum::<f64>() / brightness.len().max(1) as f64;
            vec![format!("{:.0} % (mean)", 100.0 * mean)]
        } else {
            brightness.iter().map(|value| format!("{:.0} %", 100.0 * value)).collect()
        };
        let decoded = chosen.len() - n_bad;
        Some(format!("{}: {decoded} of {} images decoded; brightness {}", self.name, chosen.len(), shown.join(", ")))
    }
}

fn color(frame: &Frame, entry: &CameraEntry) -> Result<Decoded, CameraFileError> {
    let (width, height) = entry.model.size();
    let mut pixels = vec![0; width as usize * height as usize * 3];
    caught(|| image_into(&frame.path, entry, &mut pixels))
        .unwrap_or_else(|text| Err(CameraFileError::decoder_panicked(&frame.path, text)))?;
    let sum: u64 = pixels.iter().map(|value| u64::from(*value)).sum();
    let brightness = sum as f64 / (pixels.len().max(1) as f64 * 255.0);
    let rgb = image::RgbImage::from_raw(width, height, pixels).unwrap_or_default();
    Ok(Decoded { rgb, brightness })
}

fn mosaic(frame: &Frame, entry: &MosaicEntry) -> Result<Decoded, CameraFileError> {
    let (width, height) = entry.model.size();
    let mut samples = vec![0_u16; width as usize * height as usize];
    mosaic_into(&frame.path, entry, &mut samples)?;
    let limit = f64::from((1_u32 << entry.bit_depth.min(16)) - 1);
    let sum: u64 = samples.iter().map(|value| u64::from(*value)).sum();
    let brightness = sum as f64 / (samples.len().max(1) as f64 * limit);
    let gray = |x: u32, y: u32| {
        let value = (255.0 * f64::from(samples[(y * width + x) as usize]) / limit).min(255.0) as u8;
        image::Rgb([value; 3])
    };
    Ok(Decoded { rgb: image::RgbImage::from_fn(width, height, gray), brightness })
}

/// The result of `call`, or the message of its panic: the decoder panics on some damaged files.
fn caught<T>(call: impl FnOnce() -> T) -> Result<T, String> {
    let hook = take_hook();
    set_hook(Box::new(|_| {}));
    let result = catch_unwind(AssertUnwindSafe(call));
    set_hook(hook);
    result.map_err(|panic| {
        let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
        text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "a panic without a text".to_owned())
    })
}
