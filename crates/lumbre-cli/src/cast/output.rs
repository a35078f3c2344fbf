//! Where answers go, piece by piece.

use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::Path;

use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use super::answers::{Block, Form, Table};
use super::npy;

/// Writes answers in one of their forms.
pub(super) enum Output<'f> {
    /// Comma-separated text; with the header as long as that is not written.
    Csv(&'f mut dyn Write, Option<String>),
    /// One array, whose header is written last.
    Npy(&'f mut File, Rows),
    /// Arrays that are gathered in a file each, as an archive holds one behind the other.
    Npz(&'f mut File, Rows, Vec<File>),
}

/// What there is so far.
pub(super) struct Rows {
    table: Table,
    count: u64,
}

impl<'f> Output<'f> {
    /// CSV. Its header comes with the first answers, so that a list without any is answered with its error alone.
    pub(super) fn csv(out: &'f mut dyn Write, table: Table) -> Self {
        Self::Csv(out, Some(table.header()))
    }

    /// Any form in a file; what does not fit there yet goes to temporary files in `folder`.
    ///
    /// # Errors
    /// Those of the system.
    pub(super) fn in_file(file: &'f mut File, form: Form, table: Table, folder: &Path) -> io::Result<Self> {
        let rows = Rows { table, count: 0 };
        match form {
            Form::Csv => Ok(Self::csv(file, table)),
            Form::Npy => {
                file.write_all(&npy::header(&table.descr(), 0))?;
                Ok(Self::Npy(file, rows))
            }
            Form::Npz => {
                let arrays: io::Result<_> =
                    table.arrays().iter().map(|_| tempfile::tempfile_in(folder)).collect();
                Ok(Self::Npz(file, rows, arrays?))
            }
        }
    }

    /// Adds answers.
    ///
    /// # Errors
    /// Those of the writer.
    pub(super) fn append(&mut self, block: &Block) -> io::Result<()> {
        match self {
            Self::Csv(out, header) => {
                write_header(out, header)?;
                out.write_all(&block.parts[0])
            }
            Self::Npy(file, rows) => {
                rows.count += block.answers;
                file.write_all(&block.parts[0])
            }
            Self::Npz(_, rows, arrays) => {
                rows.count += block.answers;
                arrays.iter_mut().zip(&block.parts).try_for_each(|(array, part)| array.write_all(part))
            }
        }
    }

    /// Completes what was written.
    ///
    /// # Errors
    /// Those of the writer.
    pub(super) fn finish(self) -> io::Result<()> {
        match self {
            Self::Csv(out, mut header) => {
                write_header(out, &mut header)?;
                out.flush()
            }
            Self::Npy(file, rows) => {
                file.seek(SeekFrom::Start(0))?;
                file.write_all(&npy::header(&rows.table.descr(), rows.count))
            }
            Self::Npz(file, rows, arrays) => {
                let mut archive = ZipWriter::new(file);
                for ((name, descr), mut array) in rows.table.arrays().iter().zip(arrays) {
                    let size = array.stream_position()?;
                    let options = SimpleFileOptions::default()
                        .compression_method(zip::CompressionMethod::Stored)
                        .last_modified_time(zip::DateTime::default())
                        // With the header, which is short.
                        .large_file(size > u64::from(u32::MAX) - 1024);
                    archive.start_file(format!("{name}.npy"), options)?;
                    archive.write_all(&npy::header(descr, rows.count))?;
                    array.seek(SeekFrom::Start(0))?;
                    io::copy(&mut array, &mut archive)?;
                }
                archive.finish()?;
                Ok(())
            }
        }
    }
}

fn write_header(out: &mut dyn Write, header: &mut Option<String>) -> io::Result<()> {
    header.take().map_or(Ok(()), |header| writeln!(out, "{header}"))
}
