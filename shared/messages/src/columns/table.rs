//! The table of all columns.

use super::{
    ClassTopic, ColorTopic, Column, ColumnField, ColumnVisitor, FieldType, InstanceTopic, MaterialTopic, Presence,
    RegionTopic, Shown, SpectraTopic, UNSEEN,
};
use crate::{ByteTable, CLASS_TABLE_VERSION, ClassId, MATERIAL_TABLE_VERSION, MaterialId, Message, SubmapTopic};

/// Declares the table: topics and their columns.
macro_rules! columns {
    ($($topic:ty => { $($key:ident: $value:expr),* $(,)? })*) => {
        /// All columns, in the order of the pipeline. Columns are declared only here.
        pub static COLUMNS: &[Column] = &[$(
            Column { topic: <$topic as Message>::TOPIC, layout: ByteTable::of::<$topic>, $($key: $value),* }
        ),*];

        /// Passes each column with a topic of its own to the visitor, with the type of its topic.
        pub fn visit_columns(visitor: &mut impl ColumnVisitor) {
            let mut columns = COLUMNS.iter();
            $(
                if let Some(column) = columns.next().filter(|column| column.has_own_topic()) {
                    visitor.visit::<$topic>(column);
                }
            )*
        }
    };
}

columns! {
    SubmapTopic => {
        name: "points",
        presence: Presence::Always,
        place: 0,
        fields: &[
            ColumnField::new("x", FieldType::Coordinate, "position of the point").unit("m"),
            ColumnField::new("y", FieldType::Coordinate, "position of the point").unit("m"),
            ColumnField::new("z", FieldType::Coordinate, "position of the point").unit("m"),
            ColumnField::new("x_lidar_position", FieldType::Coordinate, "position of the LiDAR at the shot").unit("m"),
            ColumnField::new("y_lidar_position", FieldType::Coordinate, "position of the LiDAR at the shot").unit("m"),
            ColumnField::new("z_lidar_position", FieldType::Coordinate, "position of the LiDAR at the shot").unit("m"),
            ColumnField::new("cos_angle_lidar_surface", FieldType::F32, "cosine of the angle between beam and surface normal")
                .none(-1.0),
            ColumnField::new("time", FieldType::F64, "time of the shot since 1970-01-01T00:00:00Z")
                .property("timestamp").unit("s").shown(Shown::Ramp),
            ColumnField::new("frame", FieldType::U32, "sweep number; with several LiDARs, among the sweeps of all")
                .property("index_frame").extra_byte(10, "number of the sweep"),
            ColumnField::new("intensity", FieldType::U8, "strength of the return, as the device reports it")
                .shown(Shown::RootRamp),
            ColumnField::new("laser", FieldType::U8, "laser number, 0 = lowest")
                .property("ring").extra_byte(2, "laser number, 0 = lowest"),
            ColumnField::new("azimuth_deg", FieldType::F32, "angle of the encoder").unit("degrees"),
            ColumnField::new("elevation_deg", FieldType::F32, "angle of the beam above the plane of the encoder").unit("degrees"),
            ColumnField::new("moving", FieldType::U8, "1 = on a moving object")
                .property("dynamic").extra_byte(3, "1 = on a moving object").shown(Shown::Flag),
        ],
        header_lines: &["timestamp s since 1970-01-01T00:00:00Z", "cos_angle_lidar_surface -1 where unknown"],
        description: "Position, time, angles and strength of each return",
    }
    SubmapTopic => {
        name: "lidar",
        presence: Presence::SeveralLidars,
        place: 1,
        fields: &[
            ColumnField::new("lidar", FieldType::U8, "index of the LiDAR in drive.toml").extra_byte(5, "index of the LiDAR"),
        ],
        header_lines: &["lidar index in drive.toml"],
        description: "LiDAR of each return",
    }
    ColorTopic => {
        name: "color",
        presence: Presence::Default,
        place: 4,
        fields: &[
            ColumnField::new("red", FieldType::U8, "sRGB color").row_field("r").shown(Shown::Color),
            ColumnField::new("green", FieldType::U8, "sRGB color").row_field("g"),
            ColumnField::new("blue", FieldType::U8, "sRGB color").row_field("b"),
            ColumnField::new("camera", FieldType::U8, "camera of the color")
                .none(UNSEEN as f64).extra_byte(4, "camera of the color, 255 = none"),
        ],
        header_lines: &["camera 255 where none saw the point"],
        description: "Color of each point, from the cameras",
    }
    SpectraTopic => {
        name: "spectra",
        presence: Presence::Default,
        place: 255,
        fields: &[],
        header_lines: &[],
        description: "Reflectance per band of the points that a mosaic camera saw, in files of their own",
    }
    ClassTopic => {
        name: "class",
        presence: Presence::Default,
        place: 3,
        fields: &[
            ColumnField::new("class", FieldType::U8, "class id")
                .property("semantic").row_field("class_id").none(0.0)
                .extra_byte(0, "class id, 0 = unlabeled").named(CLASS_TABLE_VERSION, class_names),
            ColumnField::new("score", FieldType::Share, "probability of the class, 0 to 1")
                .extra_byte(1, "probability of the class").shown(Shown::Ramp),
        ],
        header_lines: &[],
        description: "Class of each point",
    }
    InstanceTopic => {
        name: "instance",
        presence: Presence::Default,
        place: 2,
        fields: &[
            ColumnField::new("instance", FieldType::U32, "number of the object, the same in every submap")
                .row_field("").none(0.0).extra_byte(8, "number of the object, 0 = none").shown(Shown::Ids),
        ],
        header_lines: &["instance 0 where none"],
        description: "Object to which each point belongs",
    }
    MaterialTopic => {
        name: "material",
        presence: Presence::Setting("[colorize] materials"),
        place: 5,
        fields: &[
            ColumnField::new("material", FieldType::U8, "material id")
                .row_field("material_id").none(0.0)
                .extra_byte(6, "material id, 0 = unknown").named(MATERIAL_TABLE_VERSION, material_names),
            ColumnField::new("material_score", FieldType::Share, "probability of the material, 0 to 1")
                .row_field("score").extra_byte(7, "probability of the material").shown(Shown::Ramp),
        ],
        header_lines: &[],
        description: "Material of each point, by its spectrum",
    }
    RegionTopic => {
        name: "region",
        presence: Presence::Setting("[colorize] regions"),
        place: 6,
        fields: &[
            ColumnField::new("region", FieldType::U32, "region of equal spectra in the cubes")
                .row_field("").none(0.0).extra_byte(9, "region of equal spectra, 0 = none").shown(Shown::Ids),
        ],
        header_lines: &["region 0 where none"],
        description: "Region of the cubes in which each point lies",
    }
}

fn class_names() -> Vec<&'static str> {
    ClassId::ALL.iter().map(|class| class.name()).collect()
}

fn material_names() -> Vec<&'static str> {
    MaterialId::ALL.iter().map(|material| material.name()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn names_and_places_of_the_table_are_unique() {
        let unique = |mut names: Vec<String>| {
            let n = names.len();
            names.sort();
            names.dedup();
            assert_eq!(names.len(), n, "{names:?}");
        };
        let fields = || COLUMNS.iter().flat_map(|column| column.fields);
        unique(COLUMNS.iter().map(|column| column.name.to_owned()).collect());
        unique(COLUMNS.iter().map(|column| column.place.to_string()).collect());
        unique(fields().map(|field| field.name.to_owned()).collect());
        unique(fields().map(|field| field.property.to_owned()).collect());
        unique(fields().filter_map(|field| Some(field.extra_byte?.place.to_string())).collect());
    }

    #[test]
    fn fields_of_topics_exist_in_their_rows_and_have_their_type() {
        for column in COLUMNS.iter().filter(|column| column.has_own_topic()) {
            for field in column.fields {
                let layout = (column.layout)();
                let row = layout.row.iter().find(|row| row.name == field.row_field).expect(field.name);
                let expected = match field.kind {
                    FieldType::U8 | FieldType::Share => "u8",
                    FieldType::U32 => "u32",
                    FieldType::F32 | FieldType::Coordinate => "f32",
                    FieldType::F64 => "f64",
                };
                assert_eq!((row.kind.as_str(), row.count, row.offset), (expected, 1, column.offset_in_row(field)));
            }
        }
    }

    #[test]
    fn fields_have_descriptions_and_names_that_fit_their_files() {
        for field in COLUMNS.iter().flat_map(|column| column.fields) {
            let is_described = field.extra_byte.is_none_or(|extra| !extra.description.is_empty());
            assert!(is_described && field.name.len() < 32 && !field.description.is_empty(), "{}", field.name);
            assert!(field.extra_byte.is_none() || field.kind != FieldType::Coordinate, "{}", field.name);
            assert_eq!(field.names.is_some(), field.shown == Shown::Names, "{}", field.name);
        }
    }

    #[test]
    fn visitor_receives_every_topic_with_its_column() {
        struct Topics(BTreeSet<(&'static str, &'static str)>);
        impl ColumnVisitor for Topics {
            fn visit<T: Message>(&mut self, column: &'static Column) {
                self.0.insert((T::TOPIC, column.topic));
            }
        }
        let mut topics = Topics(BTreeSet::new());
        visit_columns(&mut topics);
        let expected =
            COLUMNS.iter().filter(|column| column.has_own_topic()).map(|column| (column.topic, column.topic));
        assert_eq!(topics.0, expected.collect());
    }
}
