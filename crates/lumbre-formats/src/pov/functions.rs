//! Functions: expressions compiled to operations on registers.

use std::rc::Rc;
use std::sync::Arc;

use lumbre_shading::pov::function::{Binary, Code, Function, Operation, Register, Unary};
use lumbre_shading::pov::{Spline, natives};

use super::lexer::{GREATER_OR_EQUAL, Kind, LESS_OR_EQUAL, NOT_EQUAL};
use super::value::Value;
use super::{Parser, Result};
use crate::{Diagnostic, FormatError};

/// The parameters of a function that the language has by itself: a point, and ten numbers.
pub(super) const NATIVE_PARAMETERS: usize = 13;

/// A function that is being compiled.
struct Draft {
    parameters: Vec<Rc<str>>,
    operations: Vec<Operation>,
}

impl Draft {
    fn push(&mut self, operation: Operation) -> Register {
        self.operations.push(operation);
        (self.operations.len() - 1) as Register
    }

    fn number(&mut self, x: f64) -> Register {
        self.push(Operation::Number(x))
    }

    /// Puts the operations of another function here, for some arguments, which is faster than to call it; `None` for
    /// one that is too long, or that has sums over its arguments.
    fn inline(&mut self, code: &Code, arguments: &[Register]) -> Option<Register> {
        let has_repeats =
            code.operations.iter().any(|operation| matches!(operation, Operation::Repeat { .. }));
        if has_repeats || self.operations.len() + code.operations.len() > MAX_INLINE {
            return None;
        }
        let mut registers: Vec<Register> = Vec::with_capacity(code.operations.len());
        for operation in &code.operations {
            let at = |register: &Register| registers[*register as usize];
            let all = |list: &[Register]| -> Box<[Register]> { list.iter().map(at).collect() };
            let own = match operation {
                Operation::Number(x) => Operation::Number(*x),
                Operation::Argument(i) => match arguments.get(*i) {
                    Some(&argument) => {
                        registers.push(argument);
                        continue;
                    }
                    None => Operation::Number(0.0),
                },
                Operation::Unary(of, x) => Operation::Unary(*of, at(x)),
                Operation::Binary(of, a, b) => Operation::Binary(*of, at(a), at(b)),
                Operation::Select(list) => Operation::Select(list.each_ref().map(at)),
                Operation::Call { function, arguments, component } => Operation::Call {
                    function: Arc::clone(function),
                    arguments: all(arguments),
                    component: *component,
                },
                Operation::Native(index, arguments) => Operation::Native(*index, all(arguments)),
                Operation::Repeat { .. } => return None,
            };
            registers.push(self.push(own));
        }
        registers.last().copied()
    }
}

/// No more operations are put in place of a call.
const MAX_INLINE: usize = 64;

impl Parser<'_, '_> {
    /// `function { … }` or `function(a, b) { … }`, whose word was taken.
    pub(super) fn function(&mut self) -> Result<Arc<Function>> {
        if !self.take(b'(')? {
            if self.is_native_call()? {
                return self.native_function();
            }
            return self.function_block(&["x", "y", "z", "u", "v"]);
        }
        let mut parameters: Vec<Rc<str>> = Vec::new();
        while !self.take(b')')? {
            let Some(word) = self.word()? else { return Err(self.unexpected("a parameter")) };
            self.peeked = None;
            parameters.push(word);
            self.comma()?;
        }
        self.body(parameters)
    }

    /// Whether `{ internal(n) }` comes next.
    fn is_native_call(&mut self) -> Result<bool> {
        Ok(self.is_mark(b'{')?
            && matches!(self.raw_ahead(0), Some(Kind::Word(word)) if &**word == "internal"))
    }

    fn native_function(&mut self) -> Result<Arc<Function>> {
        let parameters = (0..NATIVE_PARAMETERS).map(|i| format!("p{i}").into()).collect();
        self.body(parameters)
    }

    /// A function in braces of parameters that are given.
    pub(super) fn function_block(&mut self, parameters: &[&str]) -> Result<Arc<Function>> {
        self.body(parameters.iter().map(|&name| name.into()).collect())
    }

    fn body(&mut self, parameters: Vec<Rc<str>>) -> Result<Arc<Function>> {
        let outer = self.declaring.take();
        self.expect(b'{')?;
        let function = match self.word()?.as_deref() {
            Some("pattern") => {
                self.peeked = None;
                Function::Pattern(self.pattern_block()?)
            }
            Some("pigment") => {
                self.peeked = None;
                self.expect(b'{')?;
                Function::Pigment(self.pigment_body(None, b'}')?)
            }
            Some("transform") => match self.transform()? {
                Some(map) => Function::Transform(map),
                None => return Err(self.unexpected("a transform")),
            },
            Some("spline") => {
                self.peeked = None;
                Function::Spline(self.spline_block()?)
            }
            _ => {
                let mut draft = Draft { parameters, operations: Vec::new() };
                let result = self.f_logic(&mut draft)?;
                // The result is that of the last operation.
                if result as usize + 1 != draft.operations.len() {
                    let zero = draft.number(0.0);
                    draft.push(Operation::Binary(Binary::Add, result, zero));
                }
                self.budget.bytes((draft.operations.len() * size_of::<Operation>()) as u64, "functions")?;
                Function::Code(Code { parameters: draft.parameters.len(), operations: draft.operations })
            }
        };
        self.expect(b'}')?;
        self.declaring = outer;
        Ok(self.trimmed(function))
    }

    /// Functions of x, y and z alone have three parameters.
    fn trimmed(&self, function: Function) -> Arc<Function> {
        let mut function = function;
        if let Function::Code(code) = &mut function
            && code.parameters == 5
            && !uses_argument(code, 3)
            && !uses_argument(code, 4)
        {
            code.parameters = 3;
        }
        Arc::new(function)
    }

    /// `spline { … }` in braces.
    pub(super) fn spline_block(&mut self) -> Result<Arc<Spline>> {
        self.expect(b'{')?;
        let mut kind = self.spline_kind()?;
        let mut entries = Vec::new();
        let mut size = 1;
        if kind.is_none()
            && let Some(word) = self.word()?
            && let Some(Value::Spline(known)) = self.lookup(&word).map(|cell| cell.borrow().clone())
        {
            self.peeked = None;
            kind = Some(known.kind());
            if self.take(b'}')? {
                return Ok(known);
            }
        }
        while !self.take(b'}')? {
            if let Some(later) = self.spline_kind()? {
                kind = Some(later);
                continue;
            }
            let t = self.finite()?;
            self.comma()?;
            let value = self.expression()?;
            size = size.max(value.n);
            self.comma()?;
            self.budget.bytes(48, "splines")?;
            entries.push((t, value));
        }
        if entries.is_empty() {
            return Err(self.error("a spline without entries"));
        }
        let entries = entries.into_iter().map(|(t, value)| (t, value.promoted(size))).collect();
        Ok(Arc::new(Spline::new(kind.unwrap_or_default(), size, entries)))
    }

    fn f_logic(&mut self, draft: &mut Draft) -> Result<Register> {
        self.depth += 1;
        self.budget
            .nesting(self.depth, "functions")
            .map_err(|e| FormatError::from(e).or_at(|| self.place()))?;
        let mut left = self.f_comparison(draft)?;
        while let Some(mark) = self.f_operator(b"&|")? {
            let right = self.f_comparison(draft)?;
            let of = if mark == b'&' { Binary::And } else { Binary::Or };
            left = draft.push(Operation::Binary(of, left, right));
        }
        self.depth -= 1;
        Ok(left)
    }

    fn f_operator(&mut self, marks: &[u8]) -> Result<Option<u8>> {
        match self.peek()? {
            Some(Kind::Mark(mark)) if marks.contains(mark) => {
                let mark = *mark;
                self.peeked = None;
                Ok(Some(mark))
            }
            _ => Ok(None),
        }
    }

    fn f_comparison(&mut self, draft: &mut Draft) -> Result<Register> {
        let mut left = self.f_sum(draft)?;
        while let Some(mark) =
            self.f_operator(&[b'<', b'>', b'=', LESS_OR_EQUAL, GREATER_OR_EQUAL, NOT_EQUAL])?
        {
            let right = self.f_sum(draft)?;
            let of = match mark {
                b'<' => Binary::Less,
                b'>' => Binary::Greater,
                b'=' => Binary::Equal,
                LESS_OR_EQUAL => Binary::LessOrEqual,
                GREATER_OR_EQUAL => Binary::GreaterOrEqual,
                _ => Binary::NotEqual,
            };
            left = draft.push(Operation::Binary(of, left, right));
        }
        Ok(left)
    }

    fn f_sum(&mut self, draft: &mut Draft) -> Result<Register> {
        let mut left = self.f_product(draft)?;
        while let Some(mark) = self.f_operator(b"+-")? {
            let right = self.f_product(draft)?;
            let of = if mark == b'+' { Binary::Add } else { Binary::Subtract };
            left = draft.push(Operation::Binary(of, left, right));
        }
        Ok(left)
    }

    fn f_product(&mut self, draft: &mut Draft) -> Result<Register> {
        let mut left = self.f_unary(draft)?;
        while let Some(mark) = self.f_operator(b"*/")? {
            let right = self.f_unary(draft)?;
            let of = if mark == b'*' { Binary::Multiply } else { Binary::Divide };
            left = draft.push(Operation::Binary(of, left, right));
        }
        Ok(left)
    }

    fn f_unary(&mut self, draft: &mut Draft) -> Result<Register> {
        let mut marks = Vec::new();
        while let Some(mark) = self.f_operator(b"+-!")? {
            marks.push(mark);
        }
        let mut value = self.f_primary(draft)?;
        for mark in marks.into_iter().rev() {
            value = match mark {
                b'-' => draft.push(Operation::Unary(Unary::Negate, value)),
                b'!' => draft.push(Operation::Unary(Unary::Not, value)),
                _ => value,
            };
        }
        Ok(value)
    }

    fn f_primary(&mut self, draft: &mut Draft) -> Result<Register> {
        match self.peek()? {
            Some(Kind::Number(x)) => {
                let x = *x;
                self.peeked = None;
                Ok(draft.number(x))
            }
            Some(Kind::Mark(b'(')) => {
                self.peeked = None;
                let value = self.f_logic(draft)?;
                self.expect(b')')?;
                Ok(value)
            }
            Some(Kind::Word(word)) => {
                let word = Rc::clone(word);
                if let Some(i) = draft.parameters.iter().position(|name| *name == word) {
                    self.peeked = None;
                    return Ok(draft.push(Operation::Argument(i)));
                }
                self.f_named(&word, draft)
            }
            _ => Err(self.unexpected("an expression of a function")),
        }
    }

    fn f_list(&mut self, draft: &mut Draft) -> Result<Vec<Register>> {
        self.expect(b'(')?;
        let mut all = Vec::new();
        while !self.take(b')')? {
            all.push(self.f_logic(draft)?);
            self.comma()?;
        }
        Ok(all)
    }

    fn f_named(&mut self, word: &Rc<str>, draft: &mut Draft) -> Result<Register> {
        if let Some(unary) = Unary::from_name(word) {
            self.peeked = None;
            let [x] = self.f_exactly(draft)?;
            return Ok(draft.push(Operation::Unary(unary, x)));
        }
        if let Some(binary) = Binary::from_name(word) {
            self.peeked = None;
            let all = self.f_list(draft)?;
            let mut all = all.into_iter();
            let Some(first) = all.next() else { return Err(self.error("arguments are missing")) };
            return Ok(all.fold(first, |a, b| draft.push(Operation::Binary(binary, a, b))));
        }
        match &**word {
            "select" => {
                self.peeked = None;
                let all = self.f_list(draft)?;
                return match all[..] {
                    [x, negative, rest] => Ok(draft.push(Operation::Select([x, negative, rest, rest]))),
                    [x, negative, zero, positive] => {
                        Ok(draft.push(Operation::Select([x, negative, zero, positive])))
                    }
                    _ => Err(self.error("select has two or three choices")),
                };
            }
            "sum" | "prod" => {
                self.peeked = None;
                return self.f_repeat(draft, &**word == "prod");
            }
            "internal" => {
                self.peeked = None;
                self.expect(b'(')?;
                let index = self.whole(0.0, 1000.0)?;
                self.expect(b')')?;
                let arguments =
                    (0..draft.parameters.len()).map(|i| draft.push(Operation::Argument(i))).collect();
                return Ok(draft.push(Operation::Native(index, arguments)));
            }
            _ => {}
        }
        if let Some(value) = self.constant(word) {
            self.peeked = None;
            if self.f_operator(b".")?.is_some() {
                let component = self.f_component()?;
                return Ok(draft.number(value.promoted(5)[component]));
            }
            return Ok(draft.number(value.v[0]));
        }
        let Some(cell) = self.lookup(word).cloned() else {
            return Err(if super::words::is_reserved(word) {
                self.unexpected("what a function knows")
            } else {
                self.undeclared(word)
            });
        };
        self.peeked = None;
        let value = cell.borrow().clone();
        match self.indexed(value)? {
            Value::Num(num) => {
                if self.f_operator(b".")?.is_some() {
                    if self.word()?.as_deref().is_some_and(|word| word == "gray") {
                        self.peeked = None;
                        return Ok(draft.number(f64::from(num.as_colour().gray())));
                    }
                    let component = self.f_component()?;
                    return Ok(draft.number(num.promoted(5)[component]));
                }
                let x = self.as_float(&num)?;
                Ok(draft.number(x))
            }
            Value::Function(function) => self.f_call(draft, function),
            Value::Spline(spline) => self.f_call(draft, Arc::new(Function::Spline(spline))),
            other => Err(self.error(format!("a function cannot use {}", other.name()))),
        }
    }

    fn f_exactly<const N: usize>(&mut self, draft: &mut Draft) -> Result<[Register; N]> {
        let all = self.f_list(draft)?;
        let found = all.len();
        all.try_into().map_err(|_| {
            let wrong = Diagnostic::error("a wrong number of arguments");
            self.diagnostic(wrong.found(found).expected(N)).into()
        })
    }

    fn f_component(&mut self) -> Result<usize> {
        let word = self.word()?;
        self.peeked = None;
        match word.as_deref() {
            Some("x" | "u" | "red") => Ok(0),
            Some("y" | "v" | "green") => Ok(1),
            Some("z" | "blue") => Ok(2),
            Some("t" | "filter") => Ok(3),
            Some("transmit") => Ok(4),
            _ => Err(self.error("no component of a vector or a colour")),
        }
    }

    fn f_call(&mut self, draft: &mut Draft, function: Arc<Function>) -> Result<Register> {
        let arguments = self.f_list(draft)?;
        let is_native = matches!(&*function, Function::Code(code) if code.parameters == NATIVE_PARAMETERS);
        if is_native
            && let Function::Code(Code { operations, .. }) = &*function
            && let [.., Operation::Native(index, _)] = operations[..]
            && !natives::is_known(index)
        {
            let name = natives::NAMES.get(index as usize).copied().unwrap_or("internal");
            self.warn(&format!("the function f_{name} is not computed: it counts as 0"));
        }
        if !is_native && arguments.len() != function.parameters() {
            let wrong = Diagnostic::error("a function is called with a wrong number of arguments");
            return Err(self.diagnostic(wrong.found(arguments.len()).expected(function.parameters())).into());
        }
        if let Function::Code(code) = &*function
            && let Some(result) = draft.inline(code, &arguments)
        {
            return Ok(result);
        }
        let mut component = 0;
        let mut is_gray = false;
        if function.results() > 1 {
            if self.f_operator(b".")?.is_none() {
                return Err(self.error("a component of a vector or a colour is needed"));
            }
            if self.word()?.as_deref().is_some_and(|word| matches!(word, "gray" | "grey")) {
                self.peeked = None;
                is_gray = true;
            } else {
                component = self.f_component()?;
            }
        }
        let arguments: Box<[Register]> = arguments.into();
        let call = |component| Operation::Call {
            function: Arc::clone(&function),
            arguments: arguments.clone(),
            component,
        };
        if !is_gray {
            let call = call(component);
            return Ok(draft.push(call));
        }
        let channels = [call(0), call(1), call(2)];
        let mut sum = draft.number(0.0);
        for (channel, weight) in channels.into_iter().zip([0.297, 0.589, 0.114]) {
            let value = draft.push(channel);
            let weight = draft.number(weight);
            let product = draft.push(Operation::Binary(Binary::Multiply, value, weight));
            sum = draft.push(Operation::Binary(Binary::Add, sum, product));
        }
        Ok(sum)
    }

    fn f_repeat(&mut self, draft: &mut Draft, is_product: bool) -> Result<Register> {
        self.expect(b'(')?;
        let Some(name) = self.word()? else { return Err(self.unexpected("the variable of a sum")) };
        self.peeked = None;
        self.comma()?;
        let from = self.f_logic(draft)?;
        self.comma()?;
        let to = self.f_logic(draft)?;
        self.comma()?;
        let mut parameters = draft.parameters.clone();
        parameters.push(name);
        let mut inner = Draft { parameters, operations: Vec::new() };
        let result = self.f_logic(&mut inner)?;
        if result as usize + 1 != inner.operations.len() {
            let zero = inner.number(0.0);
            inner.push(Operation::Binary(Binary::Add, result, zero));
        }
        self.expect(b')')?;
        let body = Arc::new(Code { parameters: inner.parameters.len(), operations: inner.operations });
        Ok(draft.push(Operation::Repeat { is_product, from, to, body }))
    }
}

fn uses_argument(code: &Code, argument: usize) -> bool {
    code.operations.iter().any(|operation| match operation {
        Operation::Argument(i) => *i == argument,
        Operation::Repeat { body, .. } => uses_argument(body, argument),
        _ => false,
    })
}
