//! Projection methods: their names and parameters in WKT 1, and their definitions for the projection library.

/// A projection method.
#[derive(Debug, PartialEq)]
pub(super) struct Method {
    /// Key in the table of systems.
    key: &'static str,
    /// `PROJECTION` of WKT 1.
    pub(super) wkt: &'static str,
    /// Names of the parameters in WKT 1, in the order of their values.
    pub(super) parameters: &'static [&'static str],
    /// PROJ definition; `{k}` is the value with index k.
    definition: &'static str,
}

const CENTRAL: [&str; 5] =
    ["latitude_of_origin", "central_meridian", "scale_factor", "false_easting", "false_northing"];
const OBLIQUE: [&str; 7] = [
    "latitude_of_center",
    "longitude_of_center",
    "azimuth",
    "rectified_grid_angle",
    "scale_factor",
    "false_easting",
    "false_northing",
];
const POLAR: [&str; 4] = ["latitude_of_origin", "central_meridian", "false_easting", "false_northing"];

/// The methods of `registry/make.py`, which compares each system with PROJ's own definition.
static METHODS: [Method; 16] = [
    Method {
        key: "tmerc",
        wkt: "Transverse_Mercator",
        parameters: &CENTRAL,
        definition: "+proj=tmerc +lat_0={0} +lon_0={1} +k={2} +x_0={3} +y_0={4}",
    },
    Method {
        key: "lcc2",
        wkt: "Lambert_Conformal_Conic_2SP",
        parameters: &[
            "latitude_of_origin",
            "central_meridian",
            "standard_parallel_1",
            "standard_parallel_2",
            "false_easting",
            "false_northing",
        ],
        definition: "+proj=lcc +lat_0={0} +lon_0={1} +lat_1={2} +lat_2={3} +x_0={4} +y_0={5}",
    },
    Method {
        key: "lcc1",
        wkt: "Lambert_Conformal_Conic_1SP",
        parameters: &CENTRAL,
        definition: "+proj=lcc +lat_1={0} +lat_0={0} +lon_0={1} +k_0={2} +x_0={3} +y_0={4}",
    },
    Method {
        key: "aea",
        wkt: "Albers_Conic_Equal_Area",
        parameters: &[
            "latitude_of_center",
            "longitude_of_center",
            "standard_parallel_1",
            "standard_parallel_2",
            "false_easting",
            "false_northing",
        ],
        definition: "+proj=aea +lat_0={0} +lon_0={1} +lat_1={2} +lat_2={3} +x_0={4} +y_0={5}",
    },
    Method {
        key: "laea",
        wkt: "Lambert_Azimuthal_Equal_Area",
        parameters: &["latitude_of_center", "longitude_of_center", "false_easting", "false_northing"],
        definition: "+proj=laea +lat_0={0} +lon_0={1} +x_0={2} +y_0={3}",
    },
    Method {
        key: "sterea",
        wkt: "Oblique_Stereographic",
        parameters: &CENTRAL,
        definition: "+proj=sterea +lat_0={0} +lon_0={1} +k={2} +x_0={3} +y_0={4}",
    },
    Method {
        key: "ups",
        wkt: "Polar_Stereographic",
        parameters: &CENTRAL,
        definition: "+proj=stere +lat_0={0} +lon_0={1} +k={2} +x_0={3} +y_0={4}",
    },
    Method {
        key: "polar_north",
        wkt: "Polar_Stereographic",
        parameters: &POLAR,
        definition: "+proj=stere +lat_0=90 +lat_ts={0} +lon_0={1} +x_0={2} +y_0={3}",
    },
    Method {
        key: "polar_south",
        wkt: "Polar_Stereographic",
        parameters: &POLAR,
        definition: "+proj=stere +lat_0=-90 +lat_ts={0} +lon_0={1} +x_0={2} +y_0={3}",
    },
    Method {
        key: "somerc",
        wkt: "Hotine_Oblique_Mercator_Azimuth_Center",
        parameters: &OBLIQUE,
        definition: "+proj=somerc +lat_0={0} +lon_0={1} +k_0={4} +x_0={5} +y_0={6}",
    },
    Method {
        key: "omerc",
        wkt: "Hotine_Oblique_Mercator_Azimuth_Center",
        parameters: &OBLIQUE,
        definition: "+proj=omerc +lat_0={0} +lonc={1} +alpha={2} +gamma={3} +k={4} +x_0={5} +y_0={6}",
    },
    Method {
        key: "omerc_no_uoff",
        wkt: "Hotine_Oblique_Mercator",
        parameters: &OBLIQUE,
        definition: "+proj=omerc +no_uoff +lat_0={0} +lonc={1} +alpha={2} +gamma={3} +k={4} +x_0={5} +y_0={6}",
    },
    Method {
        key: "cass",
        wkt: "Cassini_Soldner",
        parameters: &POLAR,
        definition: "+proj=cass +lat_0={0} +lon_0={1} +x_0={2} +y_0={3}",
    },
    Method {
        key: "merc1",
        wkt: "Mercator_1SP",
        parameters: &["central_meridian", "scale_factor", "false_easting", "false_northing"],
        definition: "+proj=merc +lon_0={0} +k={1} +x_0={2} +y_0={3}",
    },
    Method {
        key: "poly",
        wkt: "Polyconic",
        parameters: &POLAR,
        definition: "+proj=poly +lat_0={0} +lon_0={1} +x_0={2} +y_0={3}",
    },
    Method {
        key: "krovak",
        wkt: "Krovak",
        parameters: &[
            "latitude_of_center",
            "longitude_of_center",
            "azimuth",
            "pseudo_standard_parallel_1",
            "scale_factor",
            "false_easting",
            "false_northing",
        ],
        definition: "+proj=krovak +lat_0={0} +lon_0={1} +alpha={2} +k={4} +x_0={5} +y_0={6}",
    },
];

/// The method with a key of the table of systems.
pub(super) fn method(key: &str) -> Option<&'static Method> {
    METHODS.iter().find(|method| method.key == key)
}

impl Method {
    /// PROJ definition without ellipsoid and unit.
    pub(super) fn definition(&self, values: &[&str]) -> String {
        let parts = values.iter().enumerate();
        parts.fold(self.definition.to_owned(), |text, (k, value)| text.replace(&format!("{{{k}}}"), value))
    }

    /// `PROJECTION` and `PARAMETER`s of WKT 1, each with a comma at its end.
    pub(super) fn wkt(&self, values: &[&str]) -> String {
        let parameters = self.parameters.iter().zip(values);
        let parameters: Vec<String> =
            parameters.map(|(name, value)| format!(r#"PARAMETER["{name}",{value}],"#)).collect();
        format!(r#"PROJECTION["{}"],{}"#, self.wkt, parameters.concat())
    }
}
