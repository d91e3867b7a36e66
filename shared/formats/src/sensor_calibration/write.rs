//! Writes files of generation 1.

use super::{CorrectionMatrix, Curve, FilterBand, OpticalComponent, SensorCalibration};

/// Writes indented elements.
#[derive(Default)]
struct Writer {
    text: String,
    open: Vec<String>,
}

impl Writer {
    /// Writes an element with the content that `inside` writes. `tag` is the name, then a blank and the attributes.
    fn element(&mut self, tag: &str, inside: impl FnOnce(&mut Self)) {
        self.line(&format!("<{tag}>"));
        self.open.push(tag.split(' ').next().unwrap_or(tag).to_owned());
        inside(self);
        if let Some(name) = self.open.pop() {
            self.line(&format!("</{name}>"));
        }
    }
    fn value(&mut self, name: &str, value: impl std::fmt::Display) {
        self.line(&format!("<{name}>{}</{name}>", escaped(&value.to_string())));
    }
    fn vector(&mut self, name: &str, values: impl Iterator<Item = f64>) {
        let values: Vec<String> = values.map(|value| value.to_string()).collect();
        self.line(&format!("<{name} nr_elements=\"{}\">{}</{name}>", values.len(), values.join(", ")));
    }
    fn line(&mut self, line: &str) {
        self.text.extend(std::iter::repeat_n("    ", self.open.len()));
        self.text.push_str(line);
        self.text.push('\n');
    }
}

/// Escapes text and attributes.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

pub fn xml(of: &SensorCalibration) -> String {
    let mut writer = Writer::default();
    writer.line("<?xml version=\"1.0\" encoding=\"utf-8\"?>");
    let root = format!("sensor_calibration version=\"1\" sensor_id=\"{}\"", escaped(&of.sensor_id));
    writer.element(&root, |w| {
        w.element("sensor_info version=\"1\"", |w| {
            w.value("width", of.size[0]);
            w.value("height", of.size[1]);
            if let Some(electrons) = of.full_well_electrons {
                w.value("full_well_capacity_e", electrons);
            }
        });
        w.element("filter_info version=\"1\"", |w| {
            w.element("calibration_info version=\"2\"", |w| {
                // All bands of a sensor are measured at the same wavelengths.
                if let Some(band) = of.bands.first() {
                    wavelengths(w, &band.response, ["wavelength_range_start_nm", "wavelength_range_end_nm"]);
                }
                if let Some(bits) = of.bit_depth {
                    w.value("bit_depth", bits);
                }
            });
            w.element("filter_zones", |w| {
                w.element("filter_zone version=\"3\" layout=\"MOSAIC\" index=\"0\"", |w| zone(w, of));
            });
        });
        w.element("system_info version=\"0\"", |w| {
            w.element("optical_components", |w| of.optical_components.iter().for_each(|c| component(w, c)));
            w.element("spectral_correction_info version=\"0\"", |w| {
                w.element("correction_matrices", |w| of.matrices.iter().for_each(|m| matrix(w, m)));
            });
        });
    });
    writer.text
}

/// Writes first, last and step if the steps are even, else every wavelength.
fn wavelengths(w: &mut Writer, curve: &Curve, [first_name, last_name]: [&str; 2]) {
    let samples: Vec<f64> = curve.samples().map(|(nm, _)| nm).collect();
    let first = samples[0];
    let last = samples[samples.len() - 1];
    let step = (last - first) / (samples.len().max(2) - 1) as f64;
    if samples.iter().enumerate().all(|(i, nm)| (first + step * i as f64 - nm).abs() < 1e-9) {
        w.value(first_name, first);
        w.value(last_name, last);
        w.value("wavelength_resolution_nm", step);
    } else {
        w.vector("sample_points_nm", samples.into_iter());
    }
}

fn zone(w: &mut Writer, of: &SensorCalibration) {
    w.element("filter_area version=\"0\"", |w| {
        for (name, value) in ["offset_x", "offset_y", "width", "height"].into_iter().zip(of.active_area) {
            w.value(name, value);
        }
    });
    w.value("pattern_width", of.pattern);
    w.value("pattern_height", of.pattern);
    w.value("filter_width", 1);
    w.value("filter_height", 1);
    w.value("spectral_range_start_nm", of.spectral_range_nm[0]);
    w.value("spectral_range_end_nm", of.spectral_range_nm[1]);
    w.element("bands", |w| of.bands.iter().enumerate().for_each(|(index, b)| band(w, index, b)));
}

fn band(w: &mut Writer, index: usize, band: &FilterBand) {
    w.element(&format!("band version=\"3\" index=\"{index}\" selected=\"{}\"", band.selected), |w| {
        w.element("peaks", |w| {
            for (i, peak) in band.peaks.iter().enumerate() {
                w.element(&format!("peak version=\"2\" order=\"{}\" shape=\"Fabry-Perot\"", i + 1), |w| {
                    w.value("wavelength_nm", peak.wavelength_nm);
                    w.value("fwhm_nm", peak.fwhm_nm);
                    w.value("QE", peak.quantum_efficiency);
                    w.value("contribution", peak.contribution);
                });
            }
        });
        w.vector("response", band.response.samples().map(|(_, value)| value));
    });
}

fn component(w: &mut Writer, component: &OpticalComponent) {
    w.element("optical_component version=\"0\"", |w| {
        w.value("type", &component.kind);
        w.value("tag", &component.tag);
        wavelengths(w, &component.transmission, ["wavelength_start_nm", "wavelength_end_nm"]);
        w.vector("response", component.transmission.samples().map(|(_, value)| value));
    });
}

fn matrix(w: &mut Writer, matrix: &CorrectionMatrix) {
    w.element("correction_matrix version=\"4\"", |w| {
        w.value("name", &matrix.name);
        w.value("type", &matrix.kind);
        w.element("virtual_bands", |w| {
            for row in &matrix.virtual_bands {
                w.element("virtual_band version=\"1\"", |w| {
                    w.value("wavelength_nm", row.wavelength_nm);
                    w.value("fwhm_nm", row.fwhm_nm);
                    w.vector("coefficients", row.coefficients.iter().copied());
                });
            }
        });
    });
}
