//! Checks entries of cameras without their images.

use super::Check;
use crate::manifest::{CameraEntry, MosaicEntry, WhitePanelEntry, rules};
use files::text_file::{MAX_CALIBRATION_BYTES, read_text};
use formats::sensor_calibration::SensorCalibration;
use messages::{CubeTopic, ImageTopic, MosaicTopic};

/// Number of values per pixel of a color image.
const COLORS: u64 = 3;

impl Check<'_> {
    /// Checks an entry of a color camera without its images.
    pub(super) fn camera(&mut self, index: usize, entry: &CameraEntry) {
        let key = |name: &str| format!("camera[{index}].{name}");
        rules::pose(&mut self.file, &key("body_from_camera"), &entry.body_from_camera);
        rules::lens(&mut self.file, &key("model"), &entry.model);
        rules::exposure(&mut self.file, &key("exposure_nanos"), entry.exposure_nanos);
        let (width, height) = entry.model.size();
        let n_values = u64::from(width) * u64::from(height) * COLORS;
        self.fits::<ImageTopic>(&key("model"), n_values, &format!("{width} x {height} pixels of {COLORS} colors"));
        rules::delay(&mut self.file, &key("delay_nanos"), entry.delay_nanos);
    }

    /// Checks an entry of a mosaic camera without its images. Returns the manufacturer's calibration, if it names one.
    pub(super) fn mosaic(&mut self, index: usize, entry: &MosaicEntry) -> Option<SensorCalibration> {
        let key = |name: &str| format!("mosaic[{index}].{name}");
        rules::pose(&mut self.file, &key("body_from_camera"), &entry.body_from_camera);
        rules::lens(&mut self.file, &key("model"), &entry.model);
        rules::exposure(&mut self.file, &key("exposure_nanos"), entry.exposure_nanos);
        rules::exposure(&mut self.file, &key("dark_exposure_nanos"), entry.dark_exposure_nanos);
        rules::exposure(&mut self.file, &key("white_exposure_nanos"), entry.white_exposure_nanos);
        rules::delay(&mut self.file, &key("delay_nanos"), entry.delay_nanos);
        let white = entry.white_reflectance;
        self.file.rule(&key("white_reflectance"), white > 0.0 && white <= 1.0, || {
            format!("value {white} must be above 0, up to 1")
        });
        let bits = entry.bit_depth;
        self.file.rule(&key("bit_depth"), (1..=16).contains(&bits), || format!("value {bits} must be 1 to 16"));
        let side = entry.pattern;
        let n_bands = entry.wavelengths_nm.len();
        self.file.rule(&key("pattern"), (1..=5).contains(&side), || format!("value {side} must be 1 to 5"));
        self.file.rule(&key("wavelengths_nm"), n_bands == (side as usize).saturating_pow(2), || {
            format!("{n_bands} values; expected one for each of the {side} x {side} cells of the pattern")
        });
        let are_positive = entry.wavelengths_nm.iter().all(|nm| *nm > 0.0 && nm.is_finite());
        self.file.rule(&key("wavelengths_nm"), are_positive, || "must be positive".into());
        let [x, y, w, h] = entry.active_area;
        let (width, height) = entry.model.size();
        let n_values = u64::from(width) * u64::from(height);
        self.fits::<MosaicTopic>(&key("model"), n_values, &format!("{width} x {height} pixels"));
        // Each pixel of the cube has its bands and a mask.
        let n_values = u64::from(w) * u64::from(h) * (n_bands as u64 + 1);
        self.fits::<CubeTopic>(
            &key("active_area"),
            n_values,
            &format!("a cube of {w} x {h} pixels and {n_bands} bands"),
        );
        let inside =
            u64::from(x) + u64::from(w) <= u64::from(width) && u64::from(y) + u64::from(h) <= u64::from(height);
        self.file.rule(&key("active_area"), inside && w >= side && h >= side, || {
            format!(
                "{:?} must lie in the {width} x {height} image and be at least as large as the pattern, {side}",
                entry.active_area
            )
        });
        if let Some(panel) = &entry.white_panel {
            self.white_panel(&key("white_panel"), panel, entry);
        }
        entry.sensor.as_ref().and_then(|name| self.sensor(index, entry, name))
    }

    fn white_panel(&mut self, key: &str, panel: &WhitePanelEntry, entry: &MosaicEntry) {
        if let Some(reflectances) = &panel.reflectances {
            let n_bands = entry.wavelengths_nm.len();
            let is_valid =
                reflectances.len() == n_bands && reflectances.iter().all(|white| *white > 0.0 && *white <= 1.0);
            self.file.rule(key, is_valid, || {
                format!("reflectances {reflectances:?} must be {n_bands} values above 0, up to 1, one for each band")
            });
        }
        if let Some(region) = panel.region {
            let [x, y, w, h] = region.map(u64::from);
            let [x0, y0, width, height] = entry.active_area.map(u64::from);
            let inside = x >= x0 && y >= y0 && x + w <= x0 + width && y + h <= y0 + height;
            self.file.rule(key, inside && w.min(h) >= u64::from(entry.pattern), || {
                format!(
                    "region {region:?} must lie in the active area and be at least as large as the pattern, {}",
                    entry.pattern
                )
            });
        }
    }

    /// Reads the calibration file of the manufacturer and checks that the manifest agrees with it.
    fn sensor(&mut self, index: usize, entry: &MosaicEntry, name: &str) -> Option<SensorCalibration> {
        let key = |name: &str| format!("mosaic[{index}].{name}");
        let path = self.inside(&key("sensor"), name)?;
        let text = read_text(&path, MAX_CALIBRATION_BYTES);
        let text =
            text.map_err(|error| self.file.fault(&key("sensor"), format!("{}: {error}", path.display()))).ok()?;
        let sensor = SensorCalibration::from_xml(&text);
        let sensor =
            sensor.map_err(|error| self.file.fault(&key("sensor"), format!("{}: {error}", path.display()))).ok()?;
        let same_area = entry.active_area == sensor.active_area;
        self.file.rule(&key("active_area"), same_area, || {
            format!("{:?} must be {:?}, as in {}", entry.active_area, sensor.active_area, path.display())
        });
        self.file.rule(&key("pattern"), entry.pattern == sensor.pattern, || {
            format!("value {} must be {}, as in {}", entry.pattern, sensor.pattern, path.display())
        });
        let (width, height) = entry.model.size();
        self.file.rule(&key("model"), [width, height] == sensor.size, || {
            let [w, h] = sensor.size;
            format!("size {width} x {height} must be {w} x {h}, as in {}", path.display())
        });
        let bits = sensor.bit_depth.unwrap_or(entry.bit_depth);
        self.file.rule(&key("bit_depth"), entry.bit_depth == bits, || {
            format!("value {} must be {bits}, as in {}", entry.bit_depth, path.display())
        });
        Some(sensor)
    }
}
