//! ENVI files: all data types, interleaves and byte orders, and files written by other programs.

use formats::envi::{self, Header, Image};
use std::path::{Path, PathBuf};

/// A value that depends on the position and is exact in all data types.
fn value(sample: usize, line: usize, band: usize) -> u8 {
    (sample * 20 + line * 7 + band * 3) as u8
}

const SIZES: [usize; 3] = [5, 3, 4];

fn stored(interleave: &str, bytes_of: impl Fn(u8) -> Vec<u8>) -> Vec<u8> {
    let [samples, lines, bands] = SIZES;
    let (mut sample, mut line, mut band);
    let mut bytes = Vec::new();
    for i in 0..samples * lines * bands {
        match interleave {
            "bsq" => (sample, line, band) = (i % samples, i / samples % lines, i / samples / lines),
            "bil" => (sample, line, band) = (i % samples, i / samples / bands, i / samples % bands),
            _ => (sample, line, band) = (i / bands % samples, i / bands / samples, i % bands),
        }
        bytes.extend(bytes_of(value(sample, line, band)));
    }
    bytes
}

fn written(folder: &Path, header: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join("image.hdr");
    std::fs::write(&path, header).expect("written");
    std::fs::write(folder.join("image.dat"), bytes).expect("written");
    path
}

#[test]
fn image_of_every_type_interleave_and_byte_order_is_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let [samples, lines, bands] = SIZES;
    let expected: Vec<f32> = (0..samples * lines * bands)
        .map(|i| f32::from(value(i % samples, i / samples % lines, i / samples / lines)))
        .collect();
    for interleave in ["bsq", "bil", "BIP"] {
        for order in [0, 1] {
            macro_rules! check {
                ($number:ty, $code:literal) => {{
                    let bytes = stored(&interleave.to_lowercase(), |value| {
                        let number = <$number>::from(value);
                        if order == 1 { number.to_be_bytes().to_vec() } else { number.to_le_bytes().to_vec() }
                    });
                    let header = format!(
                        "ENVI\nsamples={samples}\nlines = {lines}\nbands = {bands}\nheader offset = 6\ndata type = {}\n\
                         interleave = {interleave}\nbyte order = {order}\n",
                        $code
                    );
                    let path = written(folder.path(), &header, &[&b"offset"[..], &bytes].concat());
                    assert_eq!(envi::read(&path).expect("valid").values, expected, "{header}");
                }};
            }
            check!(u8, 1);
            check!(i16, 2);
            check!(i32, 3);
            check!(f32, 4);
            check!(f64, 5);
            check!(u16, 12);
            check!(u32, 13);
            check!(i64, 14);
            check!(u64, 15);
        }
    }
}

#[test]
fn written_image_reads_back_equal() {
    let folder = tempfile::tempdir().expect("a folder");
    let header = Header {
        description: "reflectance, {not} clipped".to_owned(),
        wavelengths: vec![470.5, 481.25],
        wavelength_units: "Nanometers".to_owned(),
        fwhm: vec![11.0, 12.0],
        band_names: vec!["blue, first".to_owned(), "green".to_owned()],
        data_ignore_value: Some(-1.0),
        ..Header::new(3, 2, 2)
    };
    let image = Image { header, values: (0..12).map(|i| i as f32 * 0.125 - 0.5).collect() };
    let path = folder.path().join("cube.hdr");
    envi::write(&path, &image).expect("written");
    let back = envi::read(&path).expect("valid");
    assert_eq!(back.values, image.values);
    assert_eq!(back.header.description, "reflectance,  not  clipped");
    assert_eq!(back.header.band_names, ["blue; first", "green"]);
    assert_eq!((&back.header.wavelengths, &back.header.fwhm), (&image.header.wavelengths, &image.header.fwhm));
    assert_eq!(back.header.data_ignore_value, Some(-1.0));
    // The image can also be read by the name of its data file.
    assert_eq!(envi::read(&folder.path().join("cube.img")).expect("valid"), back);
    let short = Image { values: vec![0.0; 11], ..image };
    assert!(envi::write(&path, &short).expect_err("too short").to_string().contains("11 values: the header needs 12"));
}

#[test]
fn invalid_header_is_reported_with_its_line() {
    let folder = tempfile::tempdir().expect("a folder");
    let said = |header: &str| {
        let path = written(folder.path(), header, &[0; 8]);
        envi::read(&path).expect_err("invalid").to_string()
    };
    assert!(said("ENVY\n").contains("image.hdr:1: \"ENVY\" is not the first line of an ENVI header"));
    assert!(
        said("ENVI\nsamples = 2\n\nbands = two\n").contains("image.hdr:4: bands = \"two\": expected an integer from 1")
    );
    assert!(said("ENVI\nsamples = 2\ndata type = 6\n").contains(":3: data type = \"6\": expected 1, 2,"));
    assert!(said("ENVI\nsamples = 2\nno value\n").contains(":3: \"no value\" is not an entry; expected `key = value`"));
    assert!(said("ENVI\nwavelength = {1,\n2\n").contains(":2: wavelength: the list has no closing brace"));
    assert!(said("ENVI\nwavelength = {1,\nx}\n").contains(":2: wavelength"));
    assert!(said("ENVI\nlines = 2\ndata type = 1\n").ends_with("image.hdr: samples is missing"));
    assert!(
        said("ENVI\nsamples = 3\nlines = 3\ndata type = 1\n")
            .ends_with("8 bytes of values: 3 samples, 3 lines and 1 bands of 1 bytes need 9")
    );
    let huge = "ENVI\nsamples = 2147483648\nlines = 2147483648\nbands = 2147483648\ndata type = 5\n";
    assert!(said(huge).ends_with("too large"));
    std::fs::remove_file(folder.path().join("image.dat")).expect("removed");
    assert!(envi::read(&folder.path().join("image.hdr")).expect_err("alone").to_string().contains("no data file"));
}

#[real_data::test("spectra/envi_white_dark")]
fn real_line_scanner_references_are_read() {
    let folder = real_data::path("spectra/envi_white_dark");
    // u16, interleaved by line, without a number of lines, with comments in its header.
    let dark = envi::read(&folder.join("darkReference.hdr")).expect("valid");
    assert_eq!((dark.header.samples, dark.header.lines, dark.header.bands), (1020, 1, 301));
    assert_eq!(dark.header.wavelengths_nm().expect("nm")[..2], [400.0, 402.0]);
    // f32, interleaved by pixel.
    let white = envi::read(&folder.join("whiteReference.bin")).expect("valid");
    assert_eq!(white.values.len(), dark.values.len());
    let mean =
        |image: &Image| image.values.iter().map(|value| f64::from(*value)).sum::<f64>() / image.values.len() as f64;
    assert!(mean(&white) > 2.0 * mean(&dark), "white {} dark {}", mean(&white), mean(&dark));
}

#[real_data::test("spectra/speclib_berlin_urban")]
fn real_library_of_urban_surfaces_is_read() {
    let folder = real_data::path("spectra/speclib_berlin_urban");
    let library = envi::read_library(&folder.join("library_berlin.sli")).expect("valid");
    assert_eq!(library.len(), 75);
    assert_eq!((library[0].name.as_str(), library[0].wavelengths_nm.len()), ("red clay tile 1", 177));
    assert!(library.iter().all(|spectrum| spectrum.reflectances.len() == 177));
    assert!(library.iter().all(|spectrum| spectrum.reflectances.iter().all(|r| (-0.01..1.2).contains(r))));
    let at = |name: &str, nm: f32| {
        let spectrum = library.iter().find(|spectrum| spectrum.name == name).expect("in the library");
        let nearest = spectrum.wavelengths_nm.iter().zip(&spectrum.reflectances);
        *nearest.min_by(|a, b| (a.0 - nm).abs().total_cmp(&(b.0 - nm).abs())).expect("not empty").1
    };
    // The red edge of plants.
    let grass = "grass (intensively manicured) 1";
    assert!(at(grass, 800.0) > 4.0 * at(grass, 670.0));
    assert!(at("asphalt 1", 800.0) < 2.0 * at("asphalt 1", 670.0));
}

#[real_data::test("spectra/ecostress_samples")]
fn real_ecostress_spectra_are_read() {
    let folder = real_data::path("spectra/ecostress_samples");
    let text = std::fs::read_to_string(folder.join("a.spectrum.txt")).expect("readable");
    let concrete = formats::ecostress::parse(&text).expect("valid");
    assert_eq!((concrete.name.as_str(), concrete.wavelengths_nm.len()), ("Construction Concrete", 561));
    assert_eq!((concrete.wavelengths_nm[0], concrete.reflectances[0]), (300.0, 8.82 / 100.0));
    for name in ["b", "c"] {
        let bytes = std::fs::read(folder.join(format!("{name}.spectrum.txt"))).expect("readable");
        let spectrum = formats::ecostress::parse(&String::from_utf8_lossy(&bytes)).expect("valid");
        assert!(spectrum.reflectances.len() > 100, "{}: {}", spectrum.name, spectrum.reflectances.len());
        assert!(spectrum.reflectances.iter().all(|r| (0.0..1.0).contains(r)), "{}", spectrum.name);
    }
    let cut = text.replace(" 0.3040\t 9.1800", " 0.3040");
    assert_eq!(formats::ecostress::parse(&cut).expect_err("cut").line, 24);
    assert_eq!(formats::ecostress::parse("Name: x\n1 2\n").expect_err("no units").line, 2);
}
