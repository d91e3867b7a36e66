use super::*;
use formats::ntv2::DatumGrid;
use geometry::Projection;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Places and their coordinates by pyproj 3.7.2 (PROJ 9.5.1): each system of the table at one place or more, 46 systems at 25 places.
/// `registry/make.py --points` writes them.
const PROJ_POINTS: &str = include_str!("registry/proj_points.csv");

/// Largest difference from PROJ, m. Where PROJ computes with the ellipsoid of ETRS89 and the project with WGS 84, 0.1 mm are due to that.
const MAX_DIFFERENCE_M: f64 = 1.5e-4;

/// A line of the table.
struct ProjPoint {
    epsg: u32,
    place: Geodetic,
    expected: [f64; 2],
}

fn proj_points() -> impl Iterator<Item = ProjPoint> {
    PROJ_POINTS.lines().skip(1).map(|line| {
        let values: Vec<f64> = line.split(',').map(|value| value.parse().expect("a number")).collect();
        let [epsg, latitude, longitude, height, east, north] = values.try_into().expect("six columns");
        let place = Geodetic::new(latitude, longitude, height).expect("a position");
        ProjPoint { epsg: epsg as u32, place, expected: [east, north] }
    })
}

#[test]
fn coordinates_of_every_system_equal_proj() {
    let mut largest: BTreeMap<u32, f64> = BTreeMap::new();
    let mut n_points = 0;
    for ProjPoint { epsg, place, expected } in proj_points() {
        let crs = Crs::from_epsg(epsg).expect("is in the table");
        let found = if crs.needs_grid() {
            // The table has positions of the datum itself.
            let [a, rf] = crs.datum.ellipsoid;
            let definition = crs.method.definition(&crs.system.values);
            let projection = Projection::new(&definition, &format!("+a={a} +rf={rf}")).expect("a projection");
            projection.project(&place).expect("projects")
        } else {
            let projection = crs.projection(None).expect("a projection");
            let found = projection.project(&place).expect("projects");
            let back = projection.unproject(found).expect("unprojects");
            let metres = |degrees: f64| degrees * 111_320.0;
            let turn = (back.longitude_deg - place.longitude_deg + 540.0).rem_euclid(360.0) - 180.0;
            let off = [
                metres(back.latitude_deg - place.latitude_deg),
                metres(turn * place.latitude_deg.to_radians().cos()),
                back.altitude_m - place.altitude_m,
            ];
            assert!(off.iter().all(|off| off.abs() < MAX_DIFFERENCE_M), "EPSG:{epsg} {place:?}: back {off:?}");
            assert_eq!(found[2], place.altitude_m, "EPSG:{epsg}");
            found
        };
        let off = (found[0] - expected[0]).hypot(found[1] - expected[1]);
        let entry = largest.entry(epsg).or_default();
        // NaN is the largest difference.
        *entry = if off <= *entry { *entry } else { off };
        n_points += 1;
    }
    assert_eq!(largest.len(), registry::systems().count());
    assert!(n_points > 3500, "{n_points} points");
    let wrong: Vec<_> = largest.iter().filter(|(_, off)| off.is_nan() || **off >= MAX_DIFFERENCE_M).collect();
    let worst = largest.values().fold(0.0_f64, |a, b| a.max(*b));
    println!("{n_points} points in {} systems: largest difference {:.3} mm", largest.len(), worst * 1e3);
    assert!(wrong.is_empty(), "EPSG numbers and m: {wrong:?}");
}

#[test]
fn systems_that_would_be_wrong_are_refused_with_the_reason() {
    for (epsg, reason) in [
        (4326, "EPSG:4326 is not a projected system of the EPSG registry (version 11.022)"),
        (
            2263,
            "EPSG:2263 (NAD83 / New York Long Island (ftUS)) is not supported: its coordinates are in US survey foot",
        ),
        (5514, "no single transformation to its datum, S-JTSK, that is accurate to 1 cm"),
        (27_572, "its longitudes count from Paris"),
        (3857, "its projection method is Popular Visualisation Pseudo Mercator"),
        (2053, "its coordinates count to the west or south"),
        (2166, "the registry replaces it by EPSG:2397"),
    ] {
        let error = Crs::from_epsg(epsg).expect_err("is refused").to_string();
        assert!(error.contains(reason), "{error}");
    }
}

#[test]
fn wkt_names_system_and_height() {
    let wkt = Crs::from_epsg(32_756).expect("is supported").wkt(&VerticalDatum::Ellipsoid);
    for part in [
        r#"COMPD_CS["WGS 84 / UTM zone 56S + ellipsoidal height",PROJCS["WGS 84 / UTM zone 56S",GEOGCS["#,
        r#"PARAMETER["central_meridian",153],PARAMETER["scale_factor",0.9996],PARAMETER["false_easting",500000],PARAMETER["false_northing",10000000],UNIT["#,
        r#"AUTHORITY["EPSG","32756"]],VERT_CS["Ellipsoid (metre)",VERT_DATUM["Ellipsoid",2002]"#,
    ] {
        assert!(wkt.contains(part), "{part}\nis not in\n{wkt}");
    }
    for system in registry::systems() {
        let wkt = Crs::from_system(system).expect("is sound").wkt(&VerticalDatum::Ellipsoid);
        assert_eq!(wkt.matches('[').count(), wkt.matches(']').count(), "{wkt}");
        assert_eq!(wkt.matches('"').count() % 2, 0, "{wkt}");
    }
}

/// A grid with one shift everywhere, 7.2 seconds to the north and 3.6 to the east, in -10 to 10 degrees of longitude.
fn datum_grid(name: &str) -> Arc<Named<DatumGrid>> {
    let count = |name: &str, value: i32| [format!("{name:8}").as_bytes(), &value.to_le_bytes(), &[0; 4]].concat();
    let number = |name: &str, value: f64| [format!("{name:8}").as_bytes(), &value.to_le_bytes()].concat();
    let word = |name: &str, value: &str| format!("{name:8}{value:8}").into_bytes();
    let mut records =
        vec![count("NUM_OREC", 11), count("NUM_SREC", 11), count("NUM_FILE", 1), word("GS_TYPE", "SECONDS")];
    records.extend(vec![word("", ""); 7]);
    records.extend([word("SUB_NAME", "A"), word("PARENT", "NONE"), word("CREATED", ""), word("UPDATED", "")]);
    let degree = 3600.0;
    records.extend([number("S_LAT", 45.0 * degree), number("N_LAT", 65.0 * degree)]);
    records.extend([number("E_LONG", -10.0 * degree), number("W_LONG", 10.0 * degree)]);
    records.extend([number("LAT_INC", 20.0 * degree), number("LONG_INC", 20.0 * degree), count("GS_COUNT", 4)]);
    let node: Vec<u8> = [7.2_f32, -3.6, 0.0, 0.0].into_iter().flat_map(f32::to_le_bytes).collect();
    records.extend(vec![node; 4]);
    let grid = DatumGrid::decode(&records.concat()).expect("is a grid");
    Arc::new(Named { name: name.to_owned(), grid })
}

#[test]
fn datum_grid_is_required_and_must_belong_to_the_system() {
    let british = Crs::from_epsg(27_700).expect("is supported");
    let error = british.projection(None).expect_err("needs a grid").to_string();
    for part in [
        "EPSG:27700 (OSGB36 / British National Grid) needs a grid of its datum in the format NTv2: OSTN15_NTv2_OSGBtoETRS.gsb",
        "Accurate to 0.03 m)",
    ] {
        assert!(error.contains(part), "{error}");
    }
    let error = british.projection(Some(&datum_grid("BETA2007.gsb"))).expect_err("is another grid").to_string();
    assert!(
        error.contains("has no grid BETA2007.gsb in the EPSG registry; expected OSTN15_NTv2_OSGBtoETRS.gsb"),
        "{error}"
    );
    let lv95 = Crs::from_epsg(2056).expect("is supported");
    let error = lv95.projection(Some(&datum_grid("CHENyx06a.gsb"))).expect_err("needs no grid").to_string();
    assert!(
        error.contains("EPSG:2056 (CH1903+ / LV95) needs no grid of its datum, CHENyx06a.gsb was given"),
        "{error}"
    );
}

/// The grids of Great Britain lead from the datum to ETRS89, the grids of Danish old systems from ETRS89 to the datum.
#[test]
fn shifts_of_a_grid_are_applied_in_its_direction() {
    for (epsg, grid, sign) in [(27_700, "ostn15_ntv2_osgbtoetrs.gsb", -1.0), (10_160, "s34j_2022.gsb", 1.0)] {
        let crs = Crs::from_epsg(epsg).expect("is supported");
        let projection = crs.projection(Some(&datum_grid(grid))).expect("a projection");
        let place = Geodetic::new(55.0, 8.0, 40.0).expect("a position");
        let in_datum = Geodetic::new(55.0 + sign * 0.002, 8.0 + sign * 0.001, 40.0).expect("a position");
        let [a, rf] = crs.datum.ellipsoid;
        let definition = crs.method.definition(&crs.system.values);
        let plain = Projection::new(&definition, &format!("+a={a} +rf={rf}")).expect("a projection");
        let expected = plain.project(&in_datum).expect("projects");
        let found = projection.project(&place).expect("projects");
        assert!((0..3).all(|k| (found[k] - expected[k]).abs() < 1e-3), "EPSG:{epsg}: {found:?} {expected:?}");
        let back = projection.unproject(found).expect("unprojects");
        assert!((back.latitude_deg - 55.0).abs() < 1e-9 && (back.longitude_deg - 8.0).abs() < 1e-9, "{back:?}");
        let outside = Geodetic::new(55.0, 10.5, 0.0).expect("a position");
        let error = projection.project(&outside).expect_err("is outside").to_string();
        assert!(error.contains("longitude 10.500000 is outside of the datum grid"), "{error}");
    }
}
