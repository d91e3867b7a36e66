use super::*;
use crate::run_folder::Georeference;

fn georeference(folder: &std::path::Path, is_utm: bool) -> Georeference {
    let path = folder.join("georeference.json");
    let frame = if is_utm { "UTM 31N" } else { "local" };
    let text = format!(
        r#"{{"frame":"{frame}","trajectory_frame":"local","origin":{{"latitude_deg":48.846222,"longitude_deg":2.346414,"altitude_m":104.6}},
            "utm":{{"epsg":32631,"convergence_deg":-0.492}}}}"#
    );
    std::fs::write(&path, text).expect("writes");
    Georeference::load(&path).expect("is sound")
}

/// A plane geoid: 40 m at 48.8 degrees, 2 m less per degree of longitude.
fn geoid() -> Named<GeoidGrid> {
    let doubles = [48.0, 2.0, 1.0, 1.0].into_iter().flat_map(f64::to_be_bytes);
    let sizes = [2_i32, 2].into_iter().flat_map(i32::to_be_bytes);
    let values = [44.0_f32, 42.0, 44.0, 42.0].into_iter().flat_map(f32::to_be_bytes);
    let bytes: Vec<u8> = doubles.chain(sizes).chain(values).collect();
    Named { name: "plane.gtx".to_owned(), grid: GeoidGrid::decode(&bytes).expect("is a grid") }
}

fn above_geoid(crs: Crs) -> MapChoice {
    MapChoice { geoid: Some(geoid()), ..MapChoice::from(crs) }
}

#[test]
fn quadratics_differ_from_the_exact_projection_by_less_than_a_hundredth_of_a_millimetre() {
    let folder = tempfile::tempdir().expect("a folder");
    for is_utm in [false, true] {
        let georeference = georeference(folder.path(), is_utm);
        let start = if is_utm { [452_048.0, 5_410_567.0, 104.6] } else { [0.0; 3] };
        // UTM, a conic, a system that is shifted to an old datum, though far from its area.
        for epsg in [32_631, 2154, 2056] {
            let crs = Crs::from_epsg(epsg).expect("is supported");
            let frame = TargetFrame::projected(&georeference, above_geoid(crs)).expect("a frame");
            let mut converter = frame.converter();
            for i in 0..500 {
                let s = f64::from(i) * 37.3;
                let t = f64::from(i % 40) * 3.0 - 60.0;
                let p = [start[0] + s * (s * 1e-3).sin(), start[1] - s, start[2] + t];
                let fast = converter.convert(p).expect("converts");
                let exact = frame.from_cloud(p).expect("converts");
                let off = (0..3).map(|k| (fast[k] - exact[k]).abs()).fold(0.0, f64::max);
                assert!(off < 1e-5, "EPSG:{epsg} {p:?}: {off} m");
            }
        }
    }
}

#[test]
fn clouds_in_utm_and_in_the_local_frame_have_the_same_coordinates() {
    let folder = tempfile::tempdir().expect("a folder");
    let local = georeference(folder.path(), false);
    let utm = georeference(folder.path(), true);
    let p = [300.0, -800.0, 12.0];
    let in_utm = TargetFrame::projected(&local, Crs::from_epsg(32_631).expect("is supported")).expect("a frame");
    let in_utm = in_utm.from_cloud(p).expect("converts");
    let back = TargetFrame::local(Some(&utm)).from_cloud(in_utm).expect("converts");
    assert!((0..3).all(|k| (back[k] - p[k]).abs() < 1e-6), "{back:?}");
    let lambert = |georeference, p| {
        let crs = Crs::from_epsg(2154).expect("is supported");
        TargetFrame::projected(georeference, above_geoid(crs)).expect("a frame").from_cloud(p).expect("converts")
    };
    let a = lambert(&local, p);
    let b = lambert(&utm, in_utm);
    assert!((0..3).all(|k| (a[k] - b[k]).abs() < 1e-6), "{a:?} {b:?}");
    // 104.6 + 12 m, 6 cm of curvature, 43.3 m of geoid.
    assert!((a[2] - (116.6 + 0.057 - 43.3)).abs() < 0.01, "{a:?}");
}

#[test]
fn place_outside_of_the_geoid_is_an_error() {
    let folder = tempfile::tempdir().expect("a folder");
    let georeference = georeference(folder.path(), false);
    let crs = Crs::from_epsg(2154).expect("is supported");
    let frame = TargetFrame::projected(&georeference, above_geoid(crs)).expect("a frame");
    let error = frame.converter().convert([-40_000.0, 0.0, 0.0]).expect_err("is outside").to_string();
    assert!(error.contains("is outside of the geoid grid"), "{error}");
}

#[test]
fn heights_and_eastings_have_no_jump_at_the_antimeridian() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("georeference.json");
    let text = r#"{"frame":"FRAME","trajectory_frame":"local",
        "origin":{"latitude_deg":-16.8,"longitude_deg":179.9999,"altitude_m":10.0},
        "utm":{"epsg":32760,"convergence_deg":-0.867}}"#;
    // A geoid of 50 m + 1 m per degree of longitude from 170 to 190 degrees.
    let doubles = [-20.0, 170.0, 10.0, 10.0].into_iter().flat_map(f64::to_be_bytes);
    let sizes = [2_i32, 3].into_iter().flat_map(i32::to_be_bytes);
    let values = [50.0_f32, 60.0, 70.0, 50.0, 60.0, 70.0].into_iter().flat_map(f32::to_be_bytes);
    let grid: Vec<u8> = doubles.chain(sizes).chain(values).collect();
    let crs = || Crs::from_epsg(32_760).expect("is supported");
    let mut start = [0.0; 3];
    for frame in ["local", "UTM 60S"] {
        std::fs::write(&path, text.replace("FRAME", frame)).expect("writes");
        let georeference = Georeference::load(&path).expect("is sound");
        let geoid = Named { name: "global.gtx".to_owned(), grid: GeoidGrid::decode(&grid).expect("is a grid") };
        let choice = MapChoice { geoid: Some(geoid), ..MapChoice::from(crs()) };
        let frame = TargetFrame::projected(&georeference, choice).expect("a frame");
        let mut converter = frame.converter();
        let mut last = frame.from_cloud(start).expect("converts");
        for i in 0..100 {
            let p = [start[0] + f64::from(i), start[1], start[2]];
            let fast = converter.convert(p).expect("converts");
            let exact = frame.from_cloud(p).expect("converts");
            assert!((0..3).all(|k| (fast[k] - exact[k]).abs() < 1e-5), "{p:?}: {fast:?} {exact:?}");
            assert!((exact[0] - last[0]).abs() < 1.01 && (exact[2] - (10.0 - 60.0)).abs() < 0.01, "{p:?}: {exact:?}");
            last = exact;
        }
        let utm = TargetFrame::projected(&georeference, crs()).expect("a frame");
        start = utm.from_cloud(start).expect("converts");
    }
}
