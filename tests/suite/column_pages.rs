//! The tables of columns on the reference pages agree with the table in `messages`.

use messages::columns::{COLUMNS, Column, ColumnField, ColumnVisitor, FieldType, Presence, visit_columns};
use messages::{ByteTable, Message};
use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

/// Set to rewrite the tables instead of comparing them.
const WRITE: &str = "REPLICA_WRITE_DOCS";

fn page(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("docs/reference").join(name)
}

/// Compares the rows of the table under `heading` with `rows`, or rewrites them.
fn check_table(name: &str, heading: &str, rows: &str) {
    let path = page(name);
    let text = fs::read_to_string(&path).expect("a page is UTF-8 text");
    let (before, rest) = text.split_once(heading).unwrap_or_else(|| panic!("{name} has no table {heading}"));
    let (found, after) = rest.split_at(rest.find("\n\n").map_or(rest.len(), |end| end + 1));
    if std::env::var_os(WRITE).is_some() {
        fs::write(&path, format!("{before}{heading}{rows}{after}")).expect("written");
        return;
    }
    assert!(found == rows, "{name}: the table is out of date: run this test with {WRITE}=1 to rewrite it\n{rows}");
}

fn cells(cells: &[&str]) -> String {
    let mut row = String::from("|");
    for cell in cells {
        let _ = if cell.is_empty() { write!(row, " |") } else { write!(row, " {cell} |") };
    }
    row + "\n"
}

fn none(field: &ColumnField) -> String {
    field.none.map_or_else(String::new, |none| none.to_string())
}

#[test]
fn columns_of_clouds_are_on_the_page_of_outputs() {
    let mut columns: Vec<&Column> = COLUMNS.iter().collect();
    columns.sort_by_key(|column| column.place);
    let mut rows = String::new();
    for (column, field) in columns.iter().flat_map(|column| column.fields.iter().map(move |field| (column, field))) {
        let kind = match field.kind {
            FieldType::Coordinate | FieldType::F32 | FieldType::Share => "float",
            FieldType::F64 => "double",
            FieldType::U32 => "int",
            FieldType::U8 => "uchar",
        };
        let presence = match column.presence {
            Presence::Always => "all".to_owned(),
            Presence::SeveralLidars => "with several LiDARs".to_owned(),
            Presence::Default => format!("with topic `{}`", column.topic),
            Presence::Setting(setting) => format!("with `{setting}`"),
        };
        let property = format!("`{}`", field.property);
        rows += &cells(&[&property, kind, field.unit, &none(field), field.description, &presence]);
    }
    let heading = "| property | type | unit | none | content | in runs |\n|---|---|---|---|---|---|\n";
    check_table("outputs.md", heading, &rows);
}

#[test]
fn extra_bytes_of_records_are_on_the_page_of_deliverables() {
    let mut fields: Vec<&ColumnField> = COLUMNS.iter().flat_map(|column| column.fields).collect();
    fields.retain(|field| field.extra_byte.is_some());
    fields.sort_by_key(|field| field.extra_byte.map(|extra| extra.place));
    let mut rows = String::new();
    for field in fields {
        let kind = match field.kind {
            FieldType::Share => "u8, scale 1 / 255",
            FieldType::U8 => "u8",
            FieldType::U32 => "u32",
            FieldType::F32 | FieldType::Coordinate => "f32",
            FieldType::F64 => "f64",
        };
        rows += &cells(&[&format!("`{}`", field.extra_byte_name()), kind, &none(field), field.description]);
    }
    check_table("deliverables.md", "| field | type | none | content |\n|---|---|---|---|\n", &rows);
}

#[test]
fn topics_of_columns_are_on_the_page_of_topics_with_their_sizes() {
    struct Page(String);
    impl ColumnVisitor for Page {
        fn visit<T: Message>(&mut self, column: &'static Column) {
            let begins = |line: &&str| line.split_whitespace().next() == Some(column.topic);
            let line = self.0.lines().find(begins).unwrap_or_else(|| panic!("topics.md has no line of {}", T::TOPIC));
            let ByteTable { header_bytes, row_bytes, max_rows, .. } = ByteTable::of::<T>();
            let [queue, held, power] = [T::QUEUE, T::BORROWED, max_rows.ilog2() as usize];
            let expected = format!("{header_bytes}, {row_bytes} 2^{power} {queue} {held}");
            let found = line.split_whitespace().collect::<Vec<_>>().join(" ");
            assert!(found.ends_with(&expected), "topics.md: {line:?} must end with {expected:?}");
            let payload = self.0.split("](../../shared/messages/src/columns.rs)").next().unwrap_or_default();
            let listed = payload.rsplit("- [").next().unwrap_or_default();
            assert!(
                listed.contains(&format!("`{}`", column.topic)),
                "topics.md: the fields of {} are not linked",
                T::TOPIC
            );
        }
    }
    visit_columns(&mut Page(fs::read_to_string(page("topics.md")).expect("a page is UTF-8 text")));
}
