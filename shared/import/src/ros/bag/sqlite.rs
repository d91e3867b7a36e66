//! ROS 2 bags in `SQLite` databases: tables `topics` and `messages`.

use super::topics::{Encoding, Topics};
use super::{Container, Each, Message};
use crate::error::ImportError;
use formats::sqlite::{Database, Row, Rows, Value};
use std::cell::Cell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

// Columns of `topics`: id, name, type, serialization_format.
const NAME: usize = 1;
const TYPE: usize = 2;
const FORMAT: usize = 3;
// Columns of `messages`: id, topic_id, timestamp, data.
const TOPIC_ID: usize = 1;
const TIMESTAMP: usize = 2;
const DATA: usize = 3;

pub(super) struct Sqlite {
    path: PathBuf,
    topics: Topics,
    /// Topics by the id of their row.
    ids: BTreeMap<i64, usize>,
    /// Time of the earliest message.
    begin: Option<i64>,
}

impl Sqlite {
    pub fn open(path: &Path) -> Result<Self, ImportError> {
        let database = Database::open(path).map_err(ImportError::from_sqlite)?;
        let mut topics = Topics::default();
        let mut ids = BTreeMap::new();
        let mut rows = table(&database, path, "topics")?;
        while let Some(mut row) = rows.next_row().map_err(ImportError::from_sqlite)? {
            rows.load(&mut row).map_err(ImportError::from_sqlite)?;
            let text = |column| match row.value(column) {
                Ok(Some(Value::Text(text))) => Ok(String::from_utf8_lossy(text).into_owned()),
                Ok(value) => {
                    let rule = format!("column {column} is {value:?}; must be text");
                    Err(ImportError::at_part(path, &format!("row {} of topics", row.id()), rule))
                }
                Err(error) => Err(ImportError::from_sqlite(error)),
            };
            let encoding = (text(FORMAT)? == "cdr").then_some(Encoding::Cdr);
            ids.insert(row.id(), topics.add(&text(NAME)?, &text(TYPE)?, encoding));
        }
        let mut found = Self { path: path.to_owned(), topics, ids, begin: None };
        let mut rows = table(&database, path, "messages")?;
        while let Some(row) = rows.next_row().map_err(ImportError::from_sqlite)? {
            let topic = found.topic(&row)?;
            found.topics.count(topic, 1);
            // Rows of several topics may be in another order.
            if let Ok(Some(Value::Int(received))) = row.value(TIMESTAMP) {
                found.begin = Some(found.begin.map_or(received, |begin| begin.min(received)));
            }
        }
        Ok(found)
    }

    fn topic(&self, row: &Row<'_>) -> Result<usize, ImportError> {
        let id = self.int(row, TOPIC_ID)?;
        self.ids.get(&id).copied().ok_or_else(|| self.fault(row, format!("topic {id} is not in the table of topics")))
    }

    fn int(&self, row: &Row<'_>, column: usize) -> Result<i64, ImportError> {
        match row.value(column).map_err(ImportError::from_sqlite)? {
            Some(Value::Int(value)) => Ok(value),
            value => Err(self.fault(row, format!("column {column} is {value:?}; must be an integer"))),
        }
    }

    fn fault(&self, row: &Row<'_>, rule: String) -> ImportError {
        ImportError::at_part(&self.path, &format!("row {} of messages", row.id()), rule)
    }
}

fn table<'a>(database: &'a Database, path: &Path, name: &str) -> Result<Rows<'a>, ImportError> {
    let rows = database.rows(name).map_err(ImportError::from_sqlite)?;
    rows.ok_or_else(|| ImportError::at(path, format!("has no table {name}: it is not a ROS 2 bag")))
}

impl Container for Sqlite {
    fn topics(&self) -> &Topics {
        &self.topics
    }

    fn begin(&self) -> Option<i64> {
        self.begin
    }

    fn read(&mut self, wanted: &[Cell<bool>], each: &mut Each<'_>) -> Result<(), ImportError> {
        let database = Database::open(&self.path).map_err(ImportError::from_sqlite)?;
        let mut rows = table(&database, &self.path, "messages")?;
        while let Some(mut row) = rows.next_row().map_err(ImportError::from_sqlite)? {
            let topic = self.topic(&row)?;
            if !wanted[topic].get() {
                continue;
            }
            let received = self.int(&row, TIMESTAMP)?;
            rows.load(&mut row).map_err(ImportError::from_sqlite)?;
            match row.value(DATA).map_err(ImportError::from_sqlite)? {
                Some(Value::Blob(data)) => each(Message { topic, received, data })?,
                _ => return Err(self.fault(&row, "the message is not a blob".into())),
            }
        }
        Ok(())
    }
}
