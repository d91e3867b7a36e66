//! Reads files of any generation.

use super::xml::Element;
use super::{
    CorrectionMatrix, Curve, FilterBand, OpticalComponent, Peak, SensorCalibration, SensorCalibrationError, VirtualBand,
};
use roxmltree::Document;

type Result<T> = std::result::Result<T, SensorCalibrationError>;

/// The newest generation.
const NEWEST: u32 = 3;
/// Longest side of a sensor, px.
const MAX_SIDE: u32 = 65_536;
/// Range of plausible wavelengths, nm.
const NM: [f64; 2] = [100.0, 10_000.0];

pub fn sensor_calibration(text: &str) -> Result<SensorCalibration> {
    let document = Document::parse(text).map_err(|error| SensorCalibrationError {
        line: error.pos().row,
        element: "XML".to_owned(),
        rule: error.to_string(),
    })?;
    let root = Element(document.root_element());
    if !root.0.has_tag_name("sensor_calibration") {
        return Err(root.fault("not a sensor calibration; expected the root sensor_calibration"));
    }
    let version_text = root.attribute(&["version"])?;
    let version = version_text
        .parse()
        .ok()
        .filter(|version| *version <= NEWEST)
        .ok_or_else(|| root.fault(format!("version {version_text:?} is unknown; must be 0 to {NEWEST}")))?;
    let sensor = root.child(&["sensor_info"])?;
    let filter_info = root.child(&["filter_info"])?;
    let zone = mosaic_zone(filter_info)?;
    let size = [
        sensor.child(&["width_px", "width"])?.number(1, MAX_SIDE)?,
        sensor.child(&["height_px", "height"])?.number(1, MAX_SIDE)?,
    ];
    let pattern = pattern(zone)?;
    let calibration_info = filter_info.maybe(&["calibration_info"]);
    let bit_depth = [sensor.maybe(&["bit_depth", "input_bpp"]), calibration_info.and_then(|c| c.maybe(&["bit_depth"]))];
    let optional = |element: Option<Element<'_>>, high: f64| element.map(|e| e.number(0.0, high)).transpose();
    Ok(SensorCalibration {
        version,
        sensor_id: root.0.attribute("sensor_id").unwrap_or_default().to_owned(),
        size,
        bit_depth: bit_depth.into_iter().flatten().next().map(|e| e.number(1, 16)).transpose()?,
        full_well_electrons: optional(sensor.maybe(&["full_well_capacity_e"]), 1e9)?,
        active_area: active_area(zone.child(&["filter_area"])?, size, pattern)?,
        pattern,
        spectral_range_nm: [
            zone.child(&["spectral_range_start_nm"])?.number(NM[0], NM[1])?,
            zone.child(&["spectral_range_end_nm"])?.number(NM[0], NM[1])?,
        ],
        bands: bands(zone, calibration_info, pattern)?,
        optical_components: optical_components(root, zone)?,
        matrices: matrices(root, zone, (pattern * pattern) as usize)?,
    })
}

/// The element that describes the filters: the only zone, or `filter_info` in generation 0.
fn mosaic_zone(filter_info: Element<'_>) -> Result<Element<'_>> {
    let zone = match filter_info.maybe(&["filter_zones"]) {
        None => filter_info,
        Some(zones) => {
            if zones.children("filter_zone").count() > 1 {
                return Err(zones.fault("expected one filter_zone; sensors with several zones are not mosaic cameras"));
            }
            zones.child(&["filter_zone"])?
        }
    };
    match zone.attribute(&["layout"])? {
        "MOSAIC" => Ok(zone),
        other => Err(zone.fault(format!("layout {other:?} must be MOSAIC"))),
    }
}

fn pattern(zone: Element<'_>) -> Result<u32> {
    let side: u32 = zone.child(&["pattern_width"])?.number(1, 16)?;
    let height = zone.child(&["pattern_height"])?;
    if height.number(1, 16)? != side {
        return Err(height.fault(format!("{} must equal pattern_width, {side}", height.text())));
    }
    for name in ["filter_width", "filter_height"] {
        if let Some(filter) = zone.maybe(&[name]) {
            filter.number(1, 1)?;
        }
    }
    Ok(side)
}

fn active_area(area: Element<'_>, size: [u32; 2], pattern: u32) -> Result<[u32; 4]> {
    let side = |offset: &str, names: &[&str], limit: u32| -> Result<[u32; 2]> {
        let offset = area.child(&[offset])?.number(0, limit - 1)?;
        let length = area.child(names)?;
        let value: u32 = length.number(1, MAX_SIDE)?;
        if value < pattern || value > limit - offset {
            let rule = format!(
                "{offset} + {value} px must be at least as large as the pattern, {pattern}, and lie in the image, {limit}"
            );
            return Err(length.fault(rule));
        }
        Ok([offset, value])
    };
    let [x, width] = side("offset_x", &["width", "width_px"], size[0])?;
    let [y, height] = side("offset_y", &["height", "height_px"], size[1])?;
    Ok([x, y, width, height])
}

/// Wavelengths of a vector of `n` samples, nm: listed, or given by first, last and step.
fn wavelengths(about: Element<'_>, n: usize) -> Result<Vec<f64>> {
    if let Some(points) = about.maybe(&["sample_points_nm"]) {
        let values = points.vector()?;
        if values.len() != n || values.windows(2).any(|pair| pair[1] <= pair[0]) {
            return Err(
                points.fault(format!("{} wavelengths for {n} values; expected as many, increasing", values.len()))
            );
        }
        return Ok(values);
    }
    let first_name = ["wavelength_range_start_nm", "measurement_range_start_nm", "wavelength_start_nm"];
    let last_name = ["wavelength_range_end_nm", "measurement_range_end_nm", "wavelength_end_nm"];
    let first = about.child(&first_name)?.number(NM[0], NM[1])?;
    let last = about.child(&last_name)?;
    let span = last.number(first, NM[1])? - first;
    let steps = n.max(2) - 1;
    let step_name = ["wavelength_resolution_nm", "measurement_resolution_nm"];
    if let Some(step) = about.maybe(&step_name) {
        let step_nm = step.number(1e-3, 1e3)?;
        if (span / step_nm - steps as f64).abs() > 0.01 {
            return Err(step.fault(format!("{n} values do not span {span} nm in steps of {step_nm} nm")));
        }
    }
    if span <= 0.0 {
        return Err(last.fault(format!("must be above the first wavelength, {first} nm")));
    }
    Ok((0..n).map(|i| first + span * i as f64 / steps as f64).collect())
}

fn curve(vector: Element<'_>, about: Element<'_>) -> Result<Curve> {
    let values = vector.vector()?;
    if values.is_empty() {
        return Err(vector.fault("the vector is empty"));
    }
    let wavelengths = wavelengths(about, values.len())?;
    Ok(Curve::from_samples(wavelengths.into_iter().zip(values).collect()))
}

fn bands(zone: Element<'_>, calibration_info: Option<Element<'_>>, pattern: u32) -> Result<Vec<FilterBand>> {
    let list = zone.child(&["bands"])?;
    let n = (pattern * pattern) as usize;
    let mut bands: Vec<Option<FilterBand>> = vec![None; n];
    for band in list.children("band") {
        let text = band.attribute(&["index", "pattern_position_index"])?;
        let Some(slot) = text.parse().ok().and_then(|index: usize| bands.get_mut(index)) else {
            return Err(band.fault(format!("index {text:?} must be 0 to {}", n - 1)));
        };
        if slot.is_some() {
            return Err(band.fault(format!("index {text} occurs twice")));
        }
        let response = band.child(&["response", "response_composition"])?;
        let about = [Some(band), calibration_info].into_iter().flatten();
        // A band may have its own wavelengths; otherwise the wavelengths of the file apply.
        let about = about.clone().find(|e| e.maybe(&["sample_points_nm"]).is_some()).or(calibration_info);
        let about = about.ok_or_else(|| response.fault("the file has no wavelengths for this response"))?;
        *slot = Some(FilterBand {
            selected: band.0.attribute("selected") != Some("false"),
            peaks: peaks(band)?,
            response: curve(response, about)?,
        });
    }
    let found = bands.iter().flatten().count();
    let all: Option<Vec<FilterBand>> = bands.into_iter().collect();
    all.ok_or_else(|| list.fault(format!("{found} bands; expected {n}, one for each cell of the pattern")))
}

/// Peaks in the order of the attribute `order`.
fn peaks(band: Element<'_>) -> Result<Vec<Peak>> {
    let Some(list) = band.maybe(&["peaks"]) else { return Ok(Vec::new()) };
    let mut peaks = Vec::new();
    for peak in list.children("peak") {
        let or_zero = |name: &str, high: f64| peak.maybe(&[name]).map_or(Ok(0.0), |e| e.number(0.0, high));
        let order = peak.0.attribute("order").and_then(|order| order.parse().ok()).unwrap_or(u32::MAX);
        let found = Peak {
            wavelength_nm: peak.child(&["wavelength_nm"])?.number(NM[0], NM[1])?,
            fwhm_nm: or_zero("fwhm_nm", 1e4)?,
            quantum_efficiency: or_zero("QE", 1e3)?,
            contribution: or_zero("contribution", 1e3)?,
        };
        peaks.push((order, found));
    }
    peaks.sort_by_key(|(order, _)| *order);
    Ok(peaks.into_iter().map(|(_, peak)| peak).collect())
}

fn optical_components(root: Element<'_>, zone: Element<'_>) -> Result<Vec<OpticalComponent>> {
    if let Some(filter) = zone.maybe(&["rejection_filter"]) {
        let transmission = curve(filter.child(&["filter_response"])?, filter)?;
        let tag = filter.text_of("type");
        return Ok(vec![OpticalComponent { kind: "rejection_filter".to_owned(), tag, transmission }]);
    }
    let list = root.maybe(&["system_info"]).and_then(|system| system.maybe(&["optical_components"]));
    let components = list.into_iter().flat_map(|list| list.children("optical_component"));
    let component = |component: Element<'_>| {
        let transmission = curve(component.child(&["response"])?, component)?;
        Ok(OpticalComponent { kind: component.text_of("type"), tag: component.text_of("tag"), transmission })
    };
    components.map(component).collect()
}

fn matrices(root: Element<'_>, zone: Element<'_>, n_bands: usize) -> Result<Vec<CorrectionMatrix>> {
    if let Some(info) = zone.maybe(&["spectral_correction_info"]) {
        let Some(list) = info.maybe(&["virtual_bands"]) else { return Ok(Vec::new()) };
        let rows = list.children("band").map(|band| virtual_band(band, "custom_spectral_correction", n_bands));
        let matrix = CorrectionMatrix {
            name: "custom_spectral_correction".to_owned(),
            kind: "custom".to_owned(),
            virtual_bands: rows.collect::<Result<_>>()?,
        };
        return Ok(vec![matrix]);
    }
    let Some(system) = root.maybe(&["system_info"]) else { return Ok(Vec::new()) };
    let Some(info) = system.maybe(&["spectral_correction_info"]) else { return Ok(Vec::new()) };
    let list = info.descend(&["correction_matrices"])?;
    let matrix = |matrix: Element<'_>| {
        let rows = matrix.child(&["virtual_bands"])?.children("virtual_band");
        Ok(CorrectionMatrix {
            name: matrix.text_of("name"),
            kind: matrix.child(&["type"])?.text().to_owned(),
            virtual_bands: rows.map(|row| virtual_band(row, "coefficients", n_bands)).collect::<Result<_>>()?,
        })
    };
    list.children("correction_matrix").map(matrix).collect()
}

fn virtual_band(row: Element<'_>, vector: &str, n_bands: usize) -> Result<VirtualBand> {
    let vector = row.child(&[vector])?;
    let coefficients = vector.vector()?;
    if coefficients.len() != n_bands {
        return Err(vector.fault(format!("{} coefficients; expected {n_bands}, one for each band", coefficients.len())));
    }
    Ok(VirtualBand {
        wavelength_nm: row.child(&["wavelength_nm"])?.number(NM[0], NM[1])?,
        fwhm_nm: row.maybe(&["fwhm_nm"]).map_or(Ok(0.0), |e| e.number(0.0, 1e4))?,
        coefficients,
    })
}
