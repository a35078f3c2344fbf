//! Formulas: written as plain Unicode text, and converted from there to LaTeX and MathML, also with numbers instead of
//! symbols.

use std::collections::HashMap;
use std::fmt::Write;

/// A piece of a formula.
#[derive(Clone, Debug, PartialEq)]
enum Token {
    /// A letter or word with its primes and its subscript: `O′`, `t₁`, `det`.
    Symbol { base: String, primes: usize, subscript: String },
    /// A numeral, with a power of ten if it has one.
    Number { digits: String, exponent: String },
    /// Superscript digits and signs, such as `²` or `⁻¹`.
    Power(String),
    /// √; its argument is in the parentheses that follow.
    Root,
    /// Any other character.
    Sign(char),
}

/// Words that are functions, and so never symbols.
const FUNCTIONS: [&str; 8] = ["min", "max", "sin", "cos", "tan", "atan2", "det", "sign"];

/// Subscript characters and what they stand for.
const SUBSCRIPTS: [(char, char); 25] = [
    ('₀', '0'),
    ('₁', '1'),
    ('₂', '2'),
    ('₃', '3'),
    ('₄', '4'),
    ('₅', '5'),
    ('₆', '6'),
    ('₇', '7'),
    ('₈', '8'),
    ('₉', '9'),
    ('ₐ', 'a'),
    ('ₑ', 'e'),
    ('ₕ', 'h'),
    ('ᵢ', 'i'),
    ('ⱼ', 'j'),
    ('ₖ', 'k'),
    ('ₗ', 'l'),
    ('ₘ', 'm'),
    ('ₙ', 'n'),
    ('ₒ', 'o'),
    ('ₚ', 'p'),
    ('ᵣ', 'r'),
    ('ₛ', 's'),
    ('ₓ', 'x'),
    ('ₜ', 't'),
];
/// Superscript characters and what they stand for.
const POWERS: [(char, char); 14] = [
    ('⁰', '0'),
    ('¹', '1'),
    ('²', '2'),
    ('³', '3'),
    ('⁴', '4'),
    ('⁵', '5'),
    ('⁶', '6'),
    ('⁷', '7'),
    ('⁸', '8'),
    ('⁹', '9'),
    ('⁻', '−'),
    ('ᵀ', 'T'),
    ('⁺', '+'),
    ('ⁿ', 'n'),
];
/// Greek letters with their names in LaTeX.
const GREEK: [(&str, &str); 22] = [
    ("α", "alpha"),
    ("β", "beta"),
    ("γ", "gamma"),
    ("δ", "delta"),
    ("ε", "varepsilon"),
    ("η", "eta"),
    ("θ", "theta"),
    ("κ", "kappa"),
    ("λ", "lambda"),
    ("μ", "mu"),
    ("ν", "nu"),
    ("ξ", "xi"),
    ("π", "pi"),
    ("ρ", "rho"),
    ("σ", "sigma"),
    ("τ", "tau"),
    ("φ", "varphi"),
    ("ψ", "psi"),
    ("ω", "omega"),
    ("Δ", "Delta"),
    ("Σ", "Sigma"),
    ("Φ", "Phi"),
];

fn stands_for(table: &[(char, char)], c: char) -> Option<char> {
    table.iter().find(|(from, _)| *from == c).map(|(_, to)| *to)
}

/// Whether a numeral begins here.
fn is_numeral(rest: &std::iter::Peekable<std::str::Chars<'_>>) -> bool {
    let mut ahead = rest.clone();
    ahead.next_if_eq(&'-');
    ahead.next().is_some_and(|c| c.is_ascii_digit())
}

fn tokens(formula: &str) -> Vec<Token> {
    let mut tokens = Vec::new();
    let mut rest = formula.chars().peekable();
    let take_while = |rest: &mut std::iter::Peekable<std::str::Chars<'_>>, keep: &dyn Fn(char) -> bool| {
        let mut taken = String::new();
        while let Some(c) = rest.next_if(|c| keep(*c)) {
            taken.push(c);
        }
        taken
    };
    while let Some(&c) = rest.peek() {
        if stands_for(&POWERS, c).is_some() {
            let raised = take_while(&mut rest, &|c| stands_for(&POWERS, c).is_some());
            tokens.push(Token::Power(raised.chars().filter_map(|c| stands_for(&POWERS, c)).collect()));
        } else if c.is_alphabetic() && stands_for(&SUBSCRIPTS, c).is_none() {
            let base = take_while(&mut rest, &|c| {
                (c.is_alphanumeric())
                    && stands_for(&SUBSCRIPTS, c).is_none()
                    && stands_for(&POWERS, c).is_none()
            });
            let primes = take_while(&mut rest, &|c| c == '′').chars().count();
            let low = take_while(&mut rest, &|c| stands_for(&SUBSCRIPTS, c).is_some());
            let subscript = low.chars().filter_map(|c| stands_for(&SUBSCRIPTS, c)).collect();
            tokens.push(Token::Symbol { base, primes, subscript });
        } else if is_numeral(&rest) {
            // A hyphen is the sign of a number; subtraction uses the minus sign.
            let sign = rest.next_if_eq(&'-').map_or_else(String::new, String::from);
            let digits = sign + &take_while(&mut rest, &|c| c.is_ascii_digit() || c == '.');
            let mut after = rest.clone();
            let has_e = after.next() == Some('e');
            after.next_if_eq(&'-');
            let has_exponent = has_e && after.next().is_some_and(|c| c.is_ascii_digit());
            let exponent = if has_exponent {
                rest.next();
                take_while(&mut rest, &|c| c.is_ascii_digit() || c == '-')
            } else {
                String::new()
            };
            tokens.push(Token::Number { digits, exponent });
        } else {
            rest.next();
            tokens.push(if c == '√' { Token::Root } else { Token::Sign(c) });
        }
    }
    tokens
}

/// The values of a formula's symbols, as text.
#[derive(Clone, Debug, Default)]
pub(super) struct Scope(HashMap<String, Entry>);

/// The value of a symbol, and whether digits are left out.
#[derive(Clone, Debug)]
struct Entry {
    written: String,
    is_rounded: bool,
}

/// A formula with numbers in it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PutIn {
    pub(super) written: String,
    /// Whether digits of the numbers are left out, so that the formula is only nearly equal.
    pub(super) is_rounded: bool,
    /// Whether the result that follows is equal to the last digit.
    pub(super) is_exact: bool,
}

impl PutIn {
    /// The sign between the formula and its numbers.
    pub(super) fn sign_before(&self) -> &'static str {
        if self.is_rounded { "≈" } else { "=" }
    }

    /// The sign between the numbers and their result.
    pub(super) fn sign_after(&self) -> &'static str {
        if self.is_rounded || !self.is_exact { "≈" } else { "=" }
    }
}

impl Scope {
    /// Sets the text of a symbol for the following formulas, and whether digits are left out of it.
    pub(super) fn put(&mut self, symbol: &str, written: String, is_rounded: bool) {
        self.0.insert(symbol.to_owned(), Entry { written, is_rounded });
    }

    /// The formula with the numbers in it; `None` if that adds nothing.
    pub(super) fn put_in(&self, formula: &str) -> Option<PutIn> {
        let tokens = tokens(formula);
        let mut written = String::new();
        let mut is_changed = false;
        let mut is_whole = true;
        let mut is_any_rounded = false;
        for (i, token) in tokens.iter().enumerate() {
            let Token::Symbol { base, .. } = token else {
                plain(token, &mut written);
                continue;
            };
            let mut symbol = String::new();
            plain(token, &mut symbol);
            match self.0.get(&symbol) {
                Some(Entry { written: number, is_rounded }) => {
                    is_changed = true;
                    is_any_rounded |= is_rounded;
                    let is_first = written.trim_end().is_empty() || written.ends_with(['(', '|', '√']);
                    let is_raised = matches!(tokens.get(i + 1), Some(Token::Power(_)));
                    let is_negative = number.starts_with('-');
                    if is_negative && (is_raised || !is_first) {
                        let _ = write!(written, "({number})");
                    } else {
                        written.push_str(number);
                    }
                }
                None => {
                    is_whole &= FUNCTIONS.contains(&base.as_str());
                    written.push_str(&symbol);
                }
            }
        }
        (is_changed && is_whole).then_some(PutIn { written, is_rounded: is_any_rounded, is_exact: true })
    }
}

/// The formula with a prime at each of these symbols that has none.
pub(super) fn with_primes(formula: &str, symbols: &[&str]) -> String {
    let mut written = String::new();
    for mut token in tokens(formula) {
        if let Token::Symbol { base, primes, subscript } = &mut token
            && *primes == 0
            && subscript.is_empty()
            && symbols.contains(&base.as_str())
        {
            *primes = 1;
        }
        plain(&token, &mut written);
    }
    written
}

fn plain(token: &Token, out: &mut String) {
    let raise = |table: &[(char, char)], text: &str, out: &mut String| {
        out.extend(text.chars().filter_map(|c| table.iter().find(|(_, to)| *to == c).map(|(from, _)| *from)));
    };
    match token {
        Token::Symbol { base, primes, subscript } => {
            out.push_str(base);
            out.extend(std::iter::repeat_n('′', *primes));
            raise(&SUBSCRIPTS, subscript, out);
        }
        Token::Number { digits, exponent } => {
            out.push_str(digits);
            if !exponent.is_empty() {
                let _ = write!(out, "e{exponent}");
            }
        }
        Token::Power(digits) => raise(&POWERS, digits, out),
        Token::Root => out.push('√'),
        Token::Sign(c) => out.push(*c),
    }
}

/// The formula as LaTeX, without dollar signs.
pub(super) fn latex(formula: &str) -> String {
    let tokens = tokens(formula);
    let mut out = String::new();
    let closings = closings(&tokens);
    for (i, token) in tokens.iter().enumerate() {
        match token {
            Token::Symbol { base, primes, subscript } => {
                let greek = GREEK.iter().find(|(letter, _)| letter == base);
                match greek {
                    Some((_, name)) => {
                        let _ = write!(out, "\\{name}");
                        if subscript.is_empty() && *primes == 0 {
                            out.push(' ');
                        }
                    }
                    None if base.chars().count() > 1 => {
                        let _ = write!(out, "\\operatorname{{{base}}}");
                    }
                    None => out.push_str(base),
                }
                out.extend(std::iter::repeat_n('\'', *primes));
                if !subscript.is_empty() {
                    let _ = write!(out, "_{{{subscript}}}");
                }
            }
            Token::Number { digits, exponent } => {
                out.push_str(digits);
                if !exponent.is_empty() {
                    let _ = write!(out, "\\cdot 10^{{{exponent}}}");
                }
            }
            Token::Power(digits) => {
                let _ = write!(out, "^{{{}}}", digits.replace('−', "-"));
            }
            Token::Root => out.push_str("\\sqrt"),
            Token::Sign('(') if closings.roots.contains(&i) => out.push('{'),
            Token::Sign(')') if closings.ends.contains(&i) => out.push('}'),
            Token::Sign(c) => out.push_str(match c {
                '·' => "\\cdot ",
                '×' => "\\times ",
                '−' => "-",
                '±' => "\\pm ",
                '≤' => "\\le ",
                '≥' => "\\ge ",
                '≠' => "\\ne ",
                '≈' => "\\approx ",
                '⟨' => "\\langle ",
                '⟩' => "\\rangle ",
                '→' => "\\to ",
                '∞' => "\\infty ",
                '{' => "\\{",
                '}' => "\\}",
                '∪' => "\\cup ",
                '∩' => "\\cap ",
                '∖' | '\\' => "\\setminus ",
                '%' => "\\%",
                _ => {
                    out.push(*c);
                    continue;
                }
            }),
        }
    }
    out
}

/// The parentheses of roots: the positions of their starts and ends.
struct Closings {
    roots: Vec<usize>,
    ends: Vec<usize>,
}

fn closings(tokens: &[Token]) -> Closings {
    let mut found = Closings { roots: Vec::new(), ends: Vec::new() };
    let mut open = Vec::new();
    for (i, token) in tokens.iter().enumerate() {
        match token {
            Token::Sign('(') => {
                let is_root = i > 0 && tokens[i - 1] == Token::Root;
                if is_root {
                    found.roots.push(i);
                }
                open.push(is_root);
            }
            Token::Sign(')') if open.pop() == Some(true) => found.ends.push(i),
            _ => {}
        }
    }
    found
}

/// Text with the characters replaced that mean something in HTML.
pub(super) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Which of the symbols of formulas are marked, as in a drawing: the key of a symbol's mark.
pub(super) type Marks<'a> = dyn Fn(&str) -> Option<&'a str> + 'a;

/// No symbols are marked.
pub(super) const UNMARKED: &Marks<'static> = &|_| None;

/// Characters that a quotient or a root may be wide on a narrow screen.
const NARROW: usize = 26;
/// Characters in parentheses that always stand on one line.
const SHORT: usize = 14;

/// A part of a formula.
#[derive(Clone, Debug)]
enum Part {
    /// A symbol or a number, as MathML, with about how many characters it is wide.
    Element {
        markup: String,
        width: usize,
    },
    /// A sign, and whether it is between two parts, so that a line may end after it.
    Sign {
        sign: char,
        is_between: bool,
    },
    /// In parentheses, in bars or in angle brackets.
    Group {
        brackets: [char; 2],
        inner: Vec<Part>,
    },
    Quotient {
        over: Box<Part>,
        under: Box<Part>,
    },
    Root(Vec<Part>),
    Power {
        base: Box<Part>,
        raised: String,
    },
}

/// The formula as MathML, which browsers set without help; quotients are stacked. It is several elements, between which
/// a line may end. What is too wide for a narrow screen is there twice: stacked (`class="stacked"`) and in lines
/// (`class="flat"`).
pub(super) fn mathml(formula: &str, marks: &Marks<'_>) -> String {
    let mut lines = Lines::default();
    row(&tokens(formula), marks).iter().for_each(|part| lines.add(part));
    lines.finish()
}

/// Elements of MathML, between which a line may end.
#[derive(Debug, Default)]
struct Lines {
    done: String,
    /// The element that is open.
    open: String,
}

impl Lines {
    fn end(&mut self) {
        if !self.open.is_empty() {
            let _ = write!(self.done, "<math>{}</math><wbr>", self.open);
            self.open.clear();
        }
    }

    fn finish(mut self) -> String {
        self.end();
        self.done
    }

    fn add(&mut self, part: &Part) {
        match part {
            Part::Sign { is_between, .. } => {
                self.open.push_str(&part.element());
                if *is_between {
                    self.end();
                }
            }
            Part::Group { brackets: [begin, end], inner } if width(inner) > SHORT => {
                self.open.push_str(&operator(*begin));
                inner.iter().for_each(|part| self.add(part));
                self.open.push_str(&operator(*end));
            }
            Part::Power { base, raised } => match &**base {
                Part::Group { brackets: [begin, end], inner } if width(inner) > SHORT => {
                    self.open.push_str(&operator(*begin));
                    inner.iter().for_each(|part| self.add(part));
                    let _ = write!(self.open, "<msup>{}<mn>{raised}</mn></msup>", operator(*end));
                }
                _ => self.open.push_str(&part.element()),
            },
            Part::Quotient { over, under } if part.width() > NARROW => {
                let line = Part::Sign { sign: '/', is_between: true };
                self.twice(part, &[&**over, &line, &**under]);
            }
            Part::Root(inner) if part.width() > NARROW => {
                let root = Part::Sign { sign: '√', is_between: false };
                self.twice(part, &[&root, &Part::Group { brackets: ['(', ')'], inner: inner.clone() }]);
            }
            _ => self.open.push_str(&part.element()),
        }
    }

    /// Both as it is set where there is room, and in lines where there is none.
    fn twice(&mut self, whole: &Part, parts: &[&Part]) {
        self.end();
        let mut flat = Self::default();
        parts.iter().for_each(|part| flat.add(part));
        let (stacked, flat) = (whole.element(), flat.finish());
        let _ = write!(
            self.done,
            "<span class=\"stacked\"><math>{stacked}</math></span><span class=\"flat\">{flat}</span><wbr>"
        );
    }
}

fn width(parts: &[Part]) -> usize {
    parts.iter().map(Part::width).sum()
}

fn in_row(parts: &[Part]) -> String {
    parts.iter().map(Part::element).collect()
}

impl Part {
    fn width(&self) -> usize {
        match self {
            Self::Element { width, .. } => *width,
            Self::Sign { .. } => 2,
            Self::Group { inner, .. } => width(inner) + 2,
            Self::Quotient { over, under } => over.width().max(under.width()),
            Self::Root(inner) => width(inner) + 1,
            Self::Power { base, raised } => base.width() + raised.len(),
        }
    }

    /// As one element.
    fn element(&self) -> String {
        match self {
            Self::Element { markup, .. } => markup.clone(),
            // At the end of a line it stays what it is between two parts.
            Self::Sign { sign, is_between: true } => {
                format!("<mo form=\"infix\">{}</mo>", escaped(&sign.to_string()))
            }
            Self::Sign { sign, .. } => operator(*sign),
            Self::Group { brackets: [begin, end], inner } => {
                format!("<mrow>{}{}{}</mrow>", operator(*begin), in_row(inner), operator(*end))
            }
            Self::Quotient { over, under } => {
                format!("<mfrac>{}{}</mfrac>", over.without_parentheses(), under.without_parentheses())
            }
            Self::Root(inner) => format!("<msqrt>{}</msqrt>", in_row(inner)),
            Self::Power { base, raised } => match &**base {
                // At the height of the parenthesis, not at that of what is inside.
                Self::Group { brackets: [begin, end], inner } => format!(
                    "<mrow>{}{}<msup>{}<mn>{raised}</mn></msup></mrow>",
                    operator(*begin),
                    in_row(inner),
                    operator(*end)
                ),
                _ => format!("<msup>{}<mn>{raised}</mn></msup>", base.element()),
            },
        }
    }

    /// As one element without the parentheses about all of it: the line of a quotient says as much. A vector keeps its
    /// own.
    fn without_parentheses(&self) -> String {
        match self {
            Self::Group { brackets: ['(', _], inner }
                if !inner.iter().any(|part| matches!(part, Self::Sign { sign: ',', .. })) =>
            {
                format!("<mrow>{}</mrow>", in_row(inner))
            }
            _ => self.element(),
        }
    }
}

/// A sign as an element.
fn operator(sign: char) -> String {
    let how = if matches!(sign, '(' | ')' | '[' | ']' | '|') { " stretchy=\"false\"" } else { "" };
    format!("<mo{how}>{}</mo>", escaped(&sign.to_string()))
}

/// The parts of a row: each factor is one, and each sign between.
fn row(tokens: &[Token], marks: &Marks<'_>) -> Vec<Part> {
    let mut out: Vec<Part> = Vec::new();
    let mut at = 0;
    while at < tokens.len() {
        match &tokens[at] {
            Token::Sign(c) if c.is_whitespace() => at += 1,
            // The preceding factor is divided by the following one.
            Token::Sign('/') if !out.is_empty() && at + 1 < tokens.len() => {
                let over = Box::new(out.pop().unwrap_or(Part::Root(Vec::new())));
                let mut rest = at + 1;
                let under = Box::new(factor(tokens, &mut rest, marks));
                out.push(Part::Quotient { over, under });
                at = rest;
            }
            Token::Sign(sign) if !matches!(sign, '(' | '|' | '⟨') => {
                // The sign of a number alone stays with it.
                let is_after_factor = out.last().is_some_and(|last| !matches!(last, Part::Sign { .. }));
                let is_between = is_after_factor && BETWEEN.contains(*sign);
                out.push(Part::Sign { sign: *sign, is_between });
                at += 1;
            }
            _ => out.push(factor(tokens, &mut at, marks)),
        }
    }
    out
}

/// Signs between two parts.
const BETWEEN: &str = "+−·×=≈≠,<>≤≥±∪∩∖";

/// A factor with its powers, or a sign; `at` is moved behind it.
fn factor(tokens: &[Token], at: &mut usize, marks: &Marks<'_>) -> Part {
    let mut part = match &tokens[*at] {
        token @ Token::Symbol { base, primes, subscript } => {
            let name = format!("<mi>{}</mi>", escaped(base));
            let low = format!("<mi>{subscript}</mi>");
            let primed = format!("<mo>{}</mo>", "′".repeat(*primes));
            let element = match (*primes > 0, subscript.is_empty()) {
                (false, true) => name,
                (true, true) => format!("<msup>{name}{primed}</msup>"),
                (false, false) => format!("<msub>{name}{low}</msub>"),
                (true, false) => format!("<msubsup>{name}{low}{primed}</msubsup>"),
            };
            let mut symbol = String::new();
            plain(token, &mut symbol);
            let markup = match marks(&symbol) {
                Some(key) => format!("<mrow data-mark=\"{}\">{element}</mrow>", escaped(key)),
                None => element,
            };
            Part::Element { markup, width: symbol.chars().count() }
        }
        Token::Number { digits, exponent } if exponent.is_empty() => {
            Part::Element { markup: format!("<mn>{digits}</mn>"), width: digits.len() }
        }
        Token::Number { digits, exponent } => Part::Element {
            markup: format!(
                "<mrow><mn>{digits}</mn><mo>·</mo><msup><mn>10</mn><mn>{exponent}</mn></msup></mrow>"
            ),
            width: digits.len() + exponent.len() + 3,
        },
        // Without anything below, a power stands by itself.
        Token::Power(digits) => Part::Element {
            markup: format!("<msup><mrow></mrow><mn>{digits}</mn></msup>"),
            width: digits.len(),
        },
        Token::Root => match closing(tokens, *at + 1) {
            Some(end) => {
                let inner = row(&tokens[*at + 2..end], marks);
                *at = end;
                Part::Root(inner)
            }
            None => Part::Sign { sign: '√', is_between: false },
        },
        Token::Sign(begin @ ('(' | '|' | '⟨')) => match closing(tokens, *at) {
            Some(end) => {
                let inner = row(&tokens[*at + 1..end], marks);
                *at = end;
                let close = match begin {
                    '(' => ')',
                    '⟨' => '⟩',
                    other => *other,
                };
                Part::Group { brackets: [*begin, close], inner }
            }
            None => Part::Sign { sign: *begin, is_between: false },
        },
        Token::Sign(sign) => Part::Sign { sign: *sign, is_between: false },
    };
    *at += 1;
    while let Some(Token::Power(digits)) = tokens.get(*at) {
        part = Part::Power { base: Box::new(part), raised: digits.clone() };
        *at += 1;
    }
    part
}

/// The position of the closing bracket.
fn closing(tokens: &[Token], open: usize) -> Option<usize> {
    let Some(Token::Sign(sign @ ('(' | '|' | '⟨'))) = tokens.get(open) else { return None };
    let mut depth = 0;
    for (i, token) in tokens.iter().enumerate().skip(open + 1) {
        match token {
            Token::Sign('|') if *sign == '|' && depth == 0 => return Some(i),
            Token::Sign('(' | '⟨') => depth += 1,
            Token::Sign(')' | '⟩') if depth == 0 => return (*sign != '|').then_some(i),
            Token::Sign(')' | '⟩') => depth -= 1,
            _ => {}
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plainly(formula: &str) -> String {
        mathml(formula, UNMARKED)
    }

    #[test]
    fn formulas_are_read_back_as_they_are_written() {
        for formula in ["Δ = h² − a·c", "t₁ = c/q", "O′ = M⁻¹ O", "√(x² + y²) ≤ r", "min(tₓ, t₂)", "|D′|"]
        {
            let mut written = String::new();
            tokens(formula).iter().for_each(|token| plain(token, &mut written));
            assert_eq!(written, formula);
        }
    }

    #[test]
    fn numbers_take_the_place_of_symbols() {
        let mut scope = Scope::default();
        for (symbol, number) in [("h", -5.0), ("a", 1.0), ("c", 24.0), ("t₁", 4.0)] {
            scope.put(symbol, f64::to_string(&number), false);
        }
        scope.put("x₀", "0.333333".to_owned(), true);
        let put_in = |formula: &str| scope.put_in(formula).map(|it| (it.written, it.is_rounded));
        let exactly = |written: &str| Some((written.to_owned(), false));
        assert_eq!(put_in("h² − a·c"), exactly("(-5)² − 1·24"));
        assert_eq!(put_in("a − h"), exactly("1 − (-5)"));
        assert_eq!(put_in("h − √(h)"), exactly("-5 − √(-5)"));
        assert_eq!(put_in("max(a, t₁)"), exactly("max(1, 4)"));
        // Six digits of a third are not all of them.
        assert_eq!(put_in("a + x₀"), Some(("1 + 0.333333".to_owned(), true)));
        // Partly known formulas have no numbers.
        assert_eq!(put_in("a + x"), None);
        assert_eq!(put_in("2·3"), None);
    }

    #[test]
    fn powers_of_ten_are_part_of_their_number() {
        assert_eq!(latex("1.5e-7 + 2e10"), "1.5\\cdot 10^{-7} + 2\\cdot 10^{10}");
        assert_eq!(plainly("2e-3").matches("<msup>").count(), 1);
        let mut written = String::new();
        tokens("-1.25e-8·2").iter().for_each(|token| plain(token, &mut written));
        assert_eq!(written, "-1.25e-8·2");
    }

    #[test]
    fn latex_and_mathml_are_balanced() {
        assert_eq!(latex("Δ = h² − a·c"), "\\Delta  = h^{2} - a\\cdot c");
        assert_eq!(latex("√(h² − (a + b)·c)"), "\\sqrt{h^{2} - (a + b)\\cdot c}");
        assert_eq!(latex("O′ = M⁻¹ O, t₁₂"), "O' = M^{-1} O, t_{12}");
        assert_eq!(latex("min(tₓ, ρ₁)"), "\\operatorname{min}(t_{x}, \\rho_{1})");
        let ml = plainly("√(h² − (a + b)·c) < t₁");
        assert_eq!(ml.matches("<msqrt>").count(), 1);
        assert_eq!(ml.matches("</msqrt>").count(), 1);
        assert!(ml.contains("<msup><mi>h</mi><mn>2</mn></msup>") && ml.contains("&lt;"), "{ml}");
        assert!(ml.contains("<msub><mi>t</mi><mi>1</mi></msub>"), "{ml}");
        let ml = plainly("(1, 2, 3)/|R|");
        assert!(ml.contains("(</mo><mn>1</mn>"), "{ml}");
        let ml = plainly("t₀ + (−b − √(b² − 4·a·c))/(2·a) − |D×V|²/q");
        assert_eq!(ml.matches("<mfrac>").count(), 2, "{ml}");
        assert!(ml.contains("<mfrac><mrow><mo>−</mo><mi>b</mi>"), "{ml}");
        assert!(ml.contains("<mrow><mn>2</mn><mo form=\"infix\">·</mo><mi>a</mi></mrow></mfrac>"), "{ml}");
        for tag in ["math", "mrow", "msup", "mfrac", "msqrt", "mo", "mi", "mn"] {
            let opened = ml.matches(&format!("<{tag}>")).count() + ml.matches(&format!("<{tag} ")).count();
            assert_eq!(opened, ml.matches(&format!("</{tag}>")).count(), "{tag}: {ml}");
        }
        // Unclosed brackets, and fractions without a part, stay as they are.
        for odd in ["(a", "|a", "/a", "a/", "√a", "⟨1, 2⟩", "²", "[0, 1] ∪ (2)"] {
            assert!(plainly(odd).ends_with("</math><wbr>"), "{odd}");
        }
    }
}
