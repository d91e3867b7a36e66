//! Mosaic camera calibration files: the real ones of HS02 and HS03, and small ones of every generation.

use formats::sensor_calibration::{CorrectionMatrix, Curve, SensorCalibration};

const HS03: &str = "photonfocus/CMV2K-SSM4x4-470_620-9.4.10.10_HS03-VIS.xml";
const HS02: &str = "photonfocus/CMV2K-SSM5x5-665_975-13.8.15.1_HS02-NIR.xml";

fn real(name: &str) -> SensorCalibration {
    let text = std::fs::read_to_string(real_data::path(name)).expect("readable");
    SensorCalibration::from_xml(&text).expect("the manufacturer's own file")
}

/// Largest distance between a virtual band and the peak of its row, applied to area-normalized responses, nm.
fn worst_peak_nm(matrix: &CorrectionMatrix, responses: &[Curve]) -> f64 {
    let off = matrix.virtual_bands.iter().map(|row| {
        let samples: Vec<Vec<f64>> =
            responses.iter().map(|curve| curve.samples().map(|(_, value)| value / curve.area()).collect()).collect();
        let combined = responses[0].samples().enumerate().map(|(i, (nm, _))| {
            (nm, row.coefficients.iter().zip(&samples).map(|(c, response)| c * response[i]).sum::<f64>())
        });
        (Curve::from_samples(combined.collect()).peak_nm() - row.wavelength_nm).abs()
    });
    off.fold(0.0, f64::max)
}

#[real_data::test(
    "photonfocus/CMV2K-SSM4x4-470_620-9.4.10.10_HS03-VIS.xml",
    "photonfocus/CMV2K-SSM5x5-665_975-13.8.15.1_HS02-NIR.xml"
)]
fn virtual_bands_of_real_cameras_peak_at_their_wavelengths() {
    for (name, worst_nm) in [(HS03, 2.1), (HS02, 1.7)] {
        let camera = real(name);
        let matrix = camera.reflectance_matrix().expect("for reflectances");
        for row in &matrix.virtual_bands {
            let sum: f64 = row.coefficients.iter().sum();
            assert!((sum - 1.0).abs() < 1e-3, "a white panel stays flat: {sum}");
        }
        let system: Vec<Curve> = (0..camera.bands.len()).filter_map(|k| camera.system_response(k)).collect();
        let found = worst_peak_nm(matrix, &system);
        assert!((found - worst_nm).abs() < 0.05, "{name}: {found} nm");
        // The two common mistakes give errors above 100 nm.
        let mut order: Vec<usize> = (0..camera.bands.len()).collect();
        order.sort_by(|a, b| camera.bands[*a].wavelength_nm().total_cmp(&camera.bands[*b].wavelength_nm()));
        let sorted: Vec<Curve> = order.iter().map(|k| system[*k].clone()).collect();
        let by_wavelength = worst_peak_nm(matrix, &sorted);
        let bare: Vec<Curve> = camera.bands.iter().map(|band| band.response.clone()).collect();
        let without_optics = worst_peak_nm(matrix, &bare);
        assert!(by_wavelength > 100.0 && without_optics > 100.0, "{by_wavelength} {without_optics}");
        eprintln!(
            "{name}: {found:.2} nm; in the order of wavelengths {by_wavelength:.0}, without optics {without_optics:.0} nm"
        );
    }
}

#[real_data::test(
    "photonfocus/CMV2K-SSM4x4-470_620-9.4.10.10_HS03-VIS.xml",
    "photonfocus/CMV2K-SSM5x5-665_975-13.8.15.1_HS02-NIR.xml"
)]
fn real_files_contain_the_known_camera_parameters() {
    let hs03 = real(HS03);
    assert_eq!((hs03.version, hs03.sensor_id.as_str()), (1, "9.4.10.10"));
    assert_eq!((hs03.size, hs03.active_area, hs03.pattern), ([2048, 1088], [0, 32, 2048, 1024], 4));
    assert_eq!((hs03.bit_depth, hs03.full_well_electrons), (Some(10), Some(11391.0)));
    assert_eq!((hs03.bands.len(), hs03.optical_components.len()), (16, 2));
    assert_eq!(hs03.optical_components[0].tag, "filter_lp_475_eo");
    assert_eq!(hs03.reflectance_matrix().map(|m| m.virtual_bands.len()), Some(15));
    assert_eq!((hs03.bands[0].peaks.len(), hs03.bands[0].response.n_samples()), (2, 601));
    assert!((hs03.bands[15].wavelength_nm() - 500.1).abs() < 0.1);
    let hs02 = real(HS02);
    assert_eq!((hs02.active_area, hs02.pattern, hs02.bands.len()), ([0, 0, 2045, 1085], 5, 25));
    assert_eq!(hs02.reflectance_matrix().map(|m| m.virtual_bands.len()), Some(25));
}

#[real_data::test(
    "photonfocus/CMV2K-SSM4x4-470_620-9.4.10.10_HS03-VIS.xml",
    "photonfocus/CMV2K-SSM5x5-665_975-13.8.15.1_HS02-NIR.xml"
)]
fn real_file_survives_round_trip() {
    for name in [HS03, HS02] {
        let camera = real(name);
        assert!(
            SensorCalibration::from_xml(&camera.to_xml()).expect("parses") == camera,
            "{name} changed in the round trip"
        );
    }
}

/// A camera of 2 x 2 bands, in the form of each generation.
fn small(version: u32) -> String {
    let vector = |name: &str, values: [f64; 3]| {
        let [a, b, c] = values;
        match version {
            0 => format!("<{name} nr_elements=\"3\"><data>{a}, {b},{c}</data></{name}>"),
            1 => format!("<{name} nr_elements=\"3\">{a}, {b},\n {c}</{name}>"),
            2 => format!("<{name}>{a} {b} {c}</{name}>"),
            _ => format!("<{name} nr_elements=\"3\" values=\"{a} {b} {c}\" />"),
        }
    };
    let row = |name: &str| match version {
        0 => format!("<{name} nr_elements=\"4\"><data>0.5, 0.5, -0.25, 0.25</data></{name}>"),
        1 | 2 => format!("<{name} nr_elements=\"4\">0.5, 0.5, -0.25, 0.25</{name}>"),
        _ => format!("<{name} nr_elements=\"4\" values=\"0.5 0.5 -2.5E-1 0.25\" />"),
    };
    let response = if version == 0 { "response_composition" } else { "response" };
    let index = if version == 0 { "pattern_position_index" } else { "index" };
    // The bands of the file are not in the order of the pattern.
    let bands = [2, 0, 1, 3].map(|k| {
        let center = 500.0 + 10.0 * f64::from(k);
        let values = vector(response, [0.1, 0.2 + 0.1 * f64::from(k), 0.3]);
        format!(
            "<band version=\"2\" {index}=\"{k}\" selected=\"true\"><peaks><peak order=\"1\"><wavelength_nm>{center}\
                 </wavelength_nm><fwhm_nm>8</fwhm_nm><QE>0.2</QE></peak></peaks>{values}</band>"
        )
    });
    let bands = bands.concat();
    let area = "<filter_area version=\"0\"><offset_x>1</offset_x><offset_y>2</offset_y><width>6</width><height>4</height>\
                </filter_area><pattern_width>2</pattern_width><pattern_height>2</pattern_height>\
                <spectral_range_start_nm>490</spectral_range_start_nm><spectral_range_end_nm>540</spectral_range_end_nm>";
    let filter = vector(if version == 0 { "filter_response" } else { "response" }, [0.9, 1.0, 0.8]);
    let steps = |names: [&str; 3]| format!("<{0}>480</{0}><{1}>540</{1}><{2}>30</{2}>", names[0], names[1], names[2]);
    if version == 0 {
        let measured = steps(["measurement_range_start_nm", "measurement_range_end_nm", "measurement_resolution_nm"]);
        let rejected = steps(["wavelength_start_nm", "wavelength_end_nm", "wavelength_resolution_nm"]);
        let correction = row("custom_spectral_correction");
        return format!(
            "<?xml version=\"1.0\"?>\n<sensor_calibration version=\"0\">\n<sensor_info version=\"0\"><width>8</width>\
             <height>7</height><input_bpp>10</input_bpp></sensor_info>\n<filter_info version=\"2\" layout=\"MOSAIC\">{area}\
             <calibration_info>{measured}</calibration_info>\n<spectral_correction_info><virtual_bands><band>\
             <wavelength_nm>512</wavelength_nm>{correction}</band></virtual_bands></spectral_correction_info>\n\
             <rejection_filter>{rejected}<type>bp</type>{filter}</rejection_filter>\n<bands>\n{bands}</bands>\n\
             </filter_info>\n</sensor_calibration>\n"
        );
    }
    let unit = if version == 3 { "_px" } else { "" };
    let points = |names: [&str; 3]| {
        if version == 1 { steps(names) } else { vector("sample_points_nm", [480.0, 510.0, 540.0]) }
    };
    let measured = points(["wavelength_range_start_nm", "wavelength_range_end_nm", "wavelength_resolution_nm"]);
    let transmitted = points(["wavelength_start_nm", "wavelength_end_nm", "wavelength_resolution_nm"]);
    let coefficients = row("coefficients");
    format!(
        "<?xml version=\"1.0\"?>\n<sensor_calibration version=\"{version}\" sensor_id=\"7\">\n<sensor_info><width{unit}>8\
         </width{unit}><height{unit}>7</height{unit}></sensor_info>\n<filter_info><calibration_info>{measured}<bit_depth>10\
         </bit_depth></calibration_info>\n<filter_zones><filter_zone layout=\"MOSAIC\" index=\"0\">{area}\n<bands>\n{bands}\
         </bands>\n</filter_zone></filter_zones></filter_info>\n<system_info><optical_components><optical_component>\
         <type>bandpass_filter</type><tag>bp</tag>{transmitted}{filter}</optical_component></optical_components>\n\
         <spectral_correction_info><correction_matrices><correction_matrix><name>hsi</name><type>reflectance</type>\
         <optical_components /><virtual_bands>\n<virtual_band><wavelength_nm>512</wavelength_nm>{coefficients}\
         </virtual_band></virtual_bands></correction_matrix></correction_matrices></spectral_correction_info>\
         </system_info>\n</sensor_calibration>\n"
    )
}

#[test]
fn all_four_generations_decode_equally() {
    for version in 0..=3 {
        let camera = SensorCalibration::from_xml(&small(version)).expect("parses");
        assert_eq!((camera.version, camera.size, camera.bit_depth), (version, [8, 7], Some(10)));
        assert_eq!((camera.active_area, camera.pattern), ([1, 2, 6, 4], 2));
        assert_eq!(camera.spectral_range_nm, [490.0, 540.0]);
        for (k, band) in camera.bands.iter().enumerate() {
            assert_eq!(band.wavelength_nm(), 500.0 + 10.0 * k as f64, "the order is the pattern's");
            let samples: Vec<(f64, f64)> = band.response.samples().collect();
            assert_eq!(samples, [(480.0, 0.1), (510.0, 0.2 + 0.1 * k as f64), (540.0, 0.3)]);
        }
        let through = camera.system_response(1).expect("a band");
        assert!((through.at(480.0) - 0.09).abs() < 1e-12 && (through.at(540.0) - 0.24).abs() < 1e-12);
        assert_eq!(camera.optical_components[0].tag, "bp");
        assert_eq!(camera.matrices[0].virtual_bands[0].coefficients, [0.5, 0.5, -0.25, 0.25]);
        assert_eq!(camera.reflectance_matrix().is_some(), version > 0, "generation 0 corrects signals");
    }
}

#[test]
fn faults_are_reported_with_element_and_line() {
    let broken = |from: &str, to: &str| {
        let text = small(1);
        assert!(text.contains(from), "{from}");
        SensorCalibration::from_xml(&text.replacen(from, to, 1)).expect_err(to)
    };
    for (from, to, line, element, rule) in [
        ("version=\"1\" sensor_id", "version=\"4\" sensor_id", 2, "sensor_calibration", "must be 0 to 3"),
        ("<width>8", "<width>many", 3, "sensor_info/width", "\"many\" is not a number"),
        ("<sensor_info>", "<sensor>", 0, "XML", "expected 'sensor' tag"),
        ("<width>6", "<width>8", 5, "filter_area/width", "1 + 8 px"),
        ("<pattern_height>2", "<pattern_height>3", 5, "pattern_height", "must equal pattern_width, 2"),
        ("index=\"2\"", "index=\"0\"", 8, "bands/band", "occurs twice"),
        ("index=\"2\"", "index=\"4\"", 7, "bands/band", "must be 0 to 3"),
        ("MOSAIC", "WEDGE", 5, "filter_zone", "must be MOSAIC"),
        ("nr_elements=\"3\">0.1", "nr_elements=\"3\">x", 7, "band/response", "value 1 of the vector, \"x\""),
        ("nr_elements=\"3\">0.1", "nr_elements=\"5\">0.1", 7, "band/response", "has 3 values"),
        ("0.5, 0.5, -0.25, 0.25", "0.5, 0.5, 0.25", 0, "virtual_band/coefficients", "nr_elements is \"4\""),
        ("<type>reflectance</type>", "", 0, "correction_matrix", "a child type"),
        (
            ">30</wavelength_resolution_nm>",
            ">20</wavelength_resolution_nm>",
            4,
            "wavelength_resolution_nm",
            "steps of 20",
        ),
    ] {
        let error = broken(from, to);
        assert!(error.element.ends_with(element) && error.rule.contains(rule), "{error}");
        assert!(line == 0 || error.line == line, "{error}; expected line {line}");
    }
    let foreign = SensorCalibration::from_xml("<gpx version=\"1.1\"/>").expect_err("no camera");
    assert_eq!(foreign.to_string(), "line 1, gpx: not a sensor calibration; expected the root sensor_calibration");
    assert!(SensorCalibration::from_xml("").is_err() && SensorCalibration::from_xml("GIF89a").is_err());
}
