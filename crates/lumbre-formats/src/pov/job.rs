//! What a file of settings (`.ini`) and the switches of POV-Ray's command line ask for.

/// Settings of a render, as POV-Ray's command line and its files of settings write them. What comes later counts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PovJob {
    /// The scene.
    pub input: Option<String>,
    /// The picture.
    pub output: Option<String>,
    /// The width in pixels.
    pub width: Option<u32>,
    /// The height in pixels.
    pub height: Option<u32>,
    /// Whether edges are to be smooth.
    pub antialias: Option<bool>,
    /// The value of `clock` of a still.
    pub clock: Option<f64>,
    /// The number of the first frame of an animation.
    pub initial_frame: Option<u32>,
    /// The number of the last one.
    pub final_frame: Option<u32>,
    /// The first frame that is rendered.
    pub subset_start: Option<u32>,
    /// The last frame that is rendered.
    pub subset_end: Option<u32>,
    /// The value of `clock` in the first frame.
    pub initial_clock: Option<f64>,
    /// The value of `clock` in the last frame.
    pub final_clock: Option<f64>,
    /// Whether the frame after the last one is the first one again.
    pub cyclic: bool,
    /// Folders of files that scenes include.
    pub library: Vec<String>,
    /// Numbers and texts that are declared before the scene is read, as `name=value`.
    pub declares: Vec<String>,
    /// Settings that change nothing here, but might be missed.
    pub ignored: Vec<String>,
}

/// The keys of settings that change nothing that is seen: how POV-Ray works, and what it shows meanwhile.
const SILENT: &[&str] = &[
    "all_console",
    "all_file",
    "antialias_depth",
    "antialias_gamma",
    "antialias_threshold",
    "bits_per_color",
    "bounding",
    "bounding_method",
    "bounding_threshold",
    "bsp_basecost",
    "buffer_output",
    "buffer_size",
    "compression",
    "continue_trace",
    "create_ini",
    "debug_console",
    "debug_file",
    "display",
    "display_gamma",
    "dither",
    "dither_method",
    "draw_vistas",
    "fatal_console",
    "fatal_file",
    "file_gamma",
    "grayscale_output",
    "high_reproducibility",
    "jitter",
    "jitter_amount",
    "light_buffer",
    "max_image_buffer_memory",
    "output_file_type",
    "output_to_file",
    "palette",
    "pause_when_done",
    "preview_end_size",
    "preview_start_size",
    "render_block_size",
    "render_block_step",
    "render_console",
    "render_file",
    "render_pattern",
    "remove_bounds",
    "sampling_method",
    "split_unions",
    "statistic_console",
    "statistic_file",
    "stochastic_seed",
    "test_abort",
    "test_abort_count",
    "user_abort_command",
    "user_abort_return",
    "verbose",
    "version",
    "video_mode",
    "vista_buffer",
    "warning_console",
    "warning_file",
    "warning_level",
    "work_threads",
];

/// The switches that change nothing that is seen.
const SILENT_SWITCHES: &[&str] = &[
    "AG", "AM", "BM", "BP", "BS", "B", "CC", "CD", "CP", "CX", "C", "D", "F", "GA", "GD", "GF", "GI", "GR",
    "GS", "GW", "HR", "J", "MB", "MI", "MV", "NF", "P", "RP", "RS", "RVP", "R", "SP", "SS", "SU", "TH", "UA",
    "UD", "UL", "UO", "UR", "UV", "V", "WL", "WT", "X",
];

/// The switches that have a meaning.
const SWITCHES: &[&str] = &[
    "KFI", "KFF", "KI", "KF", "KC", "K", "SF", "EF", "W", "H", "I", "O", "A", "Q", "L", "SC", "SR", "EC",
    "ER",
];

impl PovJob {
    /// Reads a file of settings up to its first section, and the section of a name.
    ///
    /// # Errors
    /// What is wrong, with its line.
    pub fn read_ini(&mut self, text: &str, section: Option<&str>) -> Result<(), String> {
        let mut counts = true;
        let mut is_there = section.is_none();
        for (number, line) in (1..).zip(text.lines()) {
            let line = line.split(';').next().unwrap_or_default().trim();
            if let Some(label) = line.strip_prefix('[') {
                let label = label.split(']').next().unwrap_or_default().trim();
                counts = section.is_some_and(|section| section.eq_ignore_ascii_case(label));
                is_there |= counts;
                continue;
            }
            if !counts || line.is_empty() {
                continue;
            }
            let outcome = if line.starts_with(['+', '-']) {
                line.split_ascii_whitespace().try_for_each(|word| match self.switch(word) {
                    Some(outcome) => outcome,
                    None => Err(format!("no switch of POV-Ray (found {word})")),
                })
            } else {
                match line.split_once('=') {
                    Some((key, value)) => self.set(key.trim(), value.trim()),
                    None => Err(format!("expected KEY=VALUE or a switch (found {line})")),
                }
            };
            outcome.map_err(|wrong| format!("line {number}: {wrong}"))?;
        }
        match section {
            Some(section) if !is_there => Err(format!("there is no section [{section}]")),
            _ => Ok(()),
        }
    }

    /// Takes a setting by its key, in any case.
    ///
    /// # Errors
    /// What is wrong with its value.
    pub fn set(&mut self, key: &str, value: &str) -> Result<(), String> {
        let key = key.to_ascii_lowercase();
        let value = value.strip_prefix('"').and_then(|rest| rest.strip_suffix('"')).unwrap_or(value);
        match &*key {
            "width" => self.width = Some(size(value)?),
            "height" => self.height = Some(size(value)?),
            "input_file_name" => self.input = Some(value.to_owned()),
            "output_file_name" => self.output = Some(value.to_owned()),
            "antialias" => self.antialias = Some(truth(value)?),
            "clock" => self.clock = Some(number(value)?),
            "initial_frame" => self.initial_frame = Some(count(value)?),
            "final_frame" => self.final_frame = Some(count(value)?),
            "subset_start_frame" => self.subset_start = Some(count(value)?),
            "subset_end_frame" => self.subset_end = Some(count(value)?),
            "initial_clock" => self.initial_clock = Some(number(value)?),
            "final_clock" => self.final_clock = Some(number(value)?),
            "cyclic_animation" => self.cyclic = truth(value)?,
            "library_path" => self.library.push(value.to_owned()),
            "declare" => self.declares.push(value.to_owned()),
            "quality" => self.quality(value)?,
            _ if SILENT.contains(&&*key) => {}
            // Empty, or 0, is what they are without being set.
            _ if value.is_empty() || matches!(value, "0" | "off" | "Off") => {}
            _ if key.ends_with("_return") => {}
            _ => self.ignored.push(format!("{key}={value}")),
        }
        Ok(())
    }

    /// Takes a switch such as `+W320`, in any case; `None` if a word is none.
    pub fn switch(&mut self, word: &str) -> Option<Result<(), String>> {
        let on = match word.as_bytes().first()? {
            b'+' => true,
            b'-' => false,
            _ => return None,
        };
        let rest = &word[1..];
        let letters = rest.bytes().take_while(u8::is_ascii_alphabetic).count();
        let begins =
            |name: &&&str| rest.get(..name.len()).is_some_and(|start| start.eq_ignore_ascii_case(name));
        // Names that are followed by a name take letters, too; others only a number.
        let fits = |name: &&&str| {
            matches!(**name, "I" | "O" | "L" | "GA" | "GD" | "GF" | "GR" | "GS" | "GW" | "F" | "D" | "V")
                || letters == name.len()
        };
        let known = SWITCHES.iter().chain(SILENT_SWITCHES).filter(begins).filter(fits);
        let name = *known.max_by_key(|name| name.len())?;
        let value = &rest[name.len()..];
        Some(match name {
            "W" => size(value).map(|value| self.width = Some(value)),
            "H" => size(value).map(|value| self.height = Some(value)),
            "I" => {
                self.input = Some(value.to_owned());
                Ok(())
            }
            "O" => {
                self.output = Some(value.to_owned());
                Ok(())
            }
            "L" => {
                self.library.push(value.to_owned());
                Ok(())
            }
            "A" => {
                self.antialias = Some(on);
                Ok(())
            }
            "Q" => self.quality(value),
            "K" => number(value).map(|value| self.clock = Some(value)),
            "KI" => number(value).map(|value| self.initial_clock = Some(value)),
            "KF" => number(value).map(|value| self.final_clock = Some(value)),
            "KFI" => count(value).map(|value| self.initial_frame = Some(value)),
            "KFF" => count(value).map(|value| self.final_frame = Some(value)),
            "SF" => count(value).map(|value| self.subset_start = Some(value)),
            "EF" => count(value).map(|value| self.subset_end = Some(value)),
            "KC" => {
                self.cyclic = on;
                Ok(())
            }
            "SC" | "SR" | "EC" | "ER" => {
                self.ignored.push(format!("{word} (--crop renders a part)"));
                Ok(())
            }
            _ => Ok(()),
        })
    }

    fn quality(&mut self, value: &str) -> Result<(), String> {
        let quality = count(value)?;
        if quality < 9 {
            self.ignored.push(format!("quality {quality}: all is rendered"));
        }
        Ok(())
    }

    /// The frames of the animation, if it is one: all of them, and those that are rendered.
    pub fn frames(&self) -> Option<([u32; 2], [u32; 2])> {
        let last = self.final_frame?;
        let first = self.initial_frame.unwrap_or(1);
        let all = [first, last.max(first)];
        let from = self.subset_start.unwrap_or(first).clamp(first, all[1]);
        let to = self.subset_end.unwrap_or(all[1]).clamp(from, all[1]);
        Some((all, [from, to]))
    }
}

fn number(value: &str) -> Result<f64, String> {
    value
        .parse()
        .ok()
        .filter(|x: &f64| x.is_finite())
        .ok_or_else(|| format!("expected a number (found \"{value}\")"))
}

fn count(value: &str) -> Result<u32, String> {
    value.parse().map_err(|_| format!("expected a whole number (found \"{value}\")"))
}

fn size(value: &str) -> Result<u32, String> {
    let size = count(value)?;
    if (1..=65_536).contains(&size) {
        Ok(size)
    } else {
        Err(format!("expected 1 to 65536 pixels (found {size})"))
    }
}

fn truth(value: &str) -> Result<bool, String> {
    match &*value.to_ascii_lowercase() {
        "on" | "true" | "yes" | "1" => Ok(true),
        "off" | "false" | "no" | "0" => Ok(false),
        _ => Err(format!("expected on or off (found \"{value}\")")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn switches_say_what_they_say_to_povray() {
        let mut job = PovJob::default();
        for word in [
            "+Iscenes/a.pov",
            "+W320",
            "+h240",
            "-A",
            "+A0.1",
            "+Q9",
            "+Lmy/includes",
            "+KFI3",
            "+KFF12",
            "+SF5",
            "+EF7",
            "+KI0.25",
            "+KF2",
            "+KC",
            "+Oout.png",
            "-D",
            "+FN16",
            "+WT4",
            "-GA",
            "+K0.5",
            "+MV3.7",
            "+AM2",
            "+R3",
            "-J",
            "+UV",
            "-P",
            "+BM2",
            "+Q0",
        ] {
            assert_eq!(job.switch(word), Some(Ok(())), "{word}");
        }
        let text = |text: &str| Some(text.to_owned());
        let expected = PovJob {
            input: text("scenes/a.pov"),
            output: text("out.png"),
            width: Some(320),
            height: Some(240),
            antialias: Some(true),
            clock: Some(0.5),
            initial_frame: Some(3),
            final_frame: Some(12),
            subset_start: Some(5),
            subset_end: Some(7),
            initial_clock: Some(0.25),
            final_clock: Some(2.0),
            cyclic: true,
            library: vec!["my/includes".to_owned()],
            declares: Vec::new(),
            ignored: vec!["quality 0: all is rendered".to_owned()],
        };
        assert_eq!(job, expected);
        assert_eq!(job.frames(), Some(([3, 12], [5, 7])));
        assert_eq!(job.switch("scene.pov"), None);
        assert_eq!(job.switch("--size"), None);
        assert_eq!(job.switch("+Zebra"), None);
        for wrong in ["+W", "+Wide", "+W0", "+Kx", "+KFI-1"] {
            assert!(job.switch(wrong).is_none_or(|outcome| outcome.is_err()), "{wrong}");
        }
    }

    #[test]
    fn a_file_of_settings_has_keys_switches_and_sections() {
        let text = "; comment\nInput_File_Name = \"two words.pov\"\nwidth=400 ; wide\n+H300 -A\nDeclare=Turns=3\n\
                    Pause_When_Done=off\n[small]\nWidth=40\n+H30\n[Movie]\nInitial_Frame=1\nFinal_Frame=20\n";
        let mut job = PovJob::default();
        job.read_ini(text, None).unwrap();
        assert_eq!(job.input.as_deref(), Some("two words.pov"));
        assert_eq!((job.width, job.height, job.antialias), (Some(400), Some(300), Some(false)));
        assert_eq!(job.frames(), None);
        assert_eq!((job.declares, job.ignored), (vec!["Turns=3".to_owned()], Vec::new()));
        let mut small = PovJob::default();
        small.read_ini(text, Some("SMALL")).unwrap();
        assert_eq!((small.width, small.height), (Some(40), Some(30)));
        let mut movie = PovJob::default();
        movie.read_ini(text, Some("movie")).unwrap();
        assert_eq!(movie.frames(), Some(([1, 20], [1, 20])));
        let wrong = |text: &str, section| PovJob::default().read_ini(text, section).unwrap_err();
        assert_eq!(wrong("Width=ten", None), "line 1: expected a whole number (found \"ten\")");
        assert_eq!(wrong("\nnonsense", None), "line 2: expected KEY=VALUE or a switch (found nonsense)");
        assert_eq!(wrong(text, Some("huge")), "there is no section [huge]");
    }
}
