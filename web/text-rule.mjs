/** ESLint rule: text that a reader sees stands in `src/text`, not in the code. */

/** Attributes that are shown or read aloud; of them, a single word is text too. */
const SHOWN = new Set(["alt", "aria-label", "aria-valuetext", "content", "label", "placeholder", "title"]);
/** Words with a space between them or beside them, or a word in title case. */
const PROSE = /\p{L}{2,}[,.:;]?\s+\p{L}+|^\s+\p{L}{2,}|\p{L}{2,}\s+$|^\p{Lu}\p{Ll}+$/u;
const WORD = /\p{L}{2,}/u;

/** The attribute of JSX that a node belongs to; null for none. */
function attributeOf(node) {
  for (let at = node.parent; at; at = at.parent) {
    if (at.type === "JSXAttribute") return at.name.name;
    if (/^JSX(Element|Fragment)$|Function|Statement|Declaration/.test(at.type)) return null;
  }
  return null;
}

function isCode(node) {
  const { parent } = node;
  return /^(Import|Export|TSLiteral|TSExternal)/.test(parent.type) || parent.type === "ThrowStatement";
}

export default {
  meta: {
    type: "problem",
    schema: [],
    docs: { description: "text that a reader sees stands in the catalogue" },
    messages: { found: "Text outside of src/text: {{text}}" },
  },
  create(context) {
    const check = (node, text) => {
      if (isCode(node)) return;
      const attribute = attributeOf(node);
      if (attribute && !SHOWN.has(attribute)) return;
      if ((attribute ? WORD : PROSE).test(text)) {
        context.report({ node, messageId: "found", data: { text: text.trim().slice(0, 60) } });
      }
    };
    return {
      JSXText: (node) => {
        if (/\p{L}/u.test(node.value)) {
          context.report({ node, messageId: "found", data: { text: node.value.trim().slice(0, 60) } });
        }
      },
      Literal: (node) => {
        if (typeof node.value === "string") check(node, node.value);
      },
      TemplateElement: (node) => check(node, node.value.cooked ?? ""),
    };
  },
};
