// The firmware's own expression parser for Python: `evaluate`.
#include "ExpressionParser.h"

RepRap reprap;
ReadWriteLock Heap::heapLock;

// What is at a path: 0 null, 1 true or false, 2 integer, 3 number and its digits, 4 text, 5 seconds; -1 nothing.
typedef int (*Lookup)(const char *path, const int *indices, int n, double *value, char *text);
static Lookup lookup;

// size_t is unsigned int on the firmware's processor, and is declared so
unsigned int NamedEnumLookup(const char *s, const char *const names[], size_t n) noexcept;
unsigned int NamedEnumLookup(const char *s, const char *const names[], unsigned int n) noexcept {
    return NamedEnumLookup(s, names, (size_t)n);
}

float fastSqrtf(float f) noexcept { return std::sqrt(f); }

static const char *format(float value, unsigned int digits) {
    static const char *const formats[] = {"%.7f", "%.1f", "%.2f", "%.3f", "%.4f", "%.5f", "%.6f", "%.7f"};
    unsigned int most = MaxFloatDigitsDisplayedAfterPoint;
    for (float f = 1.0f; most > 1 && value >= f; f *= 10.0f) --most;
    return formats[digits < most ? digits : most];
}

void ExpressionValue::AppendAsString(const StringRef& str) const {
    switch (type) {
    case TypeCode::CString: str.cat(sVal); break;
    case TypeCode::HeapString: str.cat(shVal.Get().Ptr()); break;
    case TypeCode::Float: str.catf(format(fVal, param), (double)fVal); break;
    case TypeCode::Int32: str.catf("%" PRIi32, iVal); break;
    case TypeCode::Bool: str.cat(bVal ? "true" : "false"); break;
    case TypeCode::None: str.cat("null"); break;
    default: abort();
    }
}

static bool is_found(const std::string& path, const int *indices, int n, ExpressionValue& v) {
    double values[2] = {0.0, 0.0};
    char text[256] = "";
    switch (lookup(path.c_str(), indices, n, values, text)) {
    case 0: v.SetNull(nullptr); return true;
    case 1: v.SetBool(values[0] != 0.0); return true;
    case 2: v.SetInt((int32_t)values[0]); return true;
    case 3: v.SetFloat((float)values[0], (uint32_t)values[1]); return true;
    case 4: v.SetStringHandle(StringHandle(text)); return true;
    case 5: v.SetDateTime((time_t)values[0]); return true;
    default: return false;
    }
}

const Variable *VariableSet::Lookup(const char *name, size_t length, bool) const {
    static Variable v;
    return is_found(prefix + std::string(name, length), nullptr, 0, v.v) ? &v : nullptr;
}

bool Platform::SysFileExists(const char *name) const {
    ExpressionValue v;
    return is_found(std::string("file:") + name, nullptr, 0, v);
}

ExpressionValue ObjectModel::GetObjectValueUsingTableNumber(ObjectExplorationContext& c, const void *, const char *id,
                                                            uint8_t) const {
    ExpressionValue v;
    const bool is_there = is_found(id, c.indices, (int)c.provided, v);
    if (c.wantExists) v.SetBool(is_there && v.GetType() != TypeCode::None);
    else if (!is_there) throw GCodeException("unknown value");
    return v;
}

extern "C" int evaluate(const char *text, Lookup how, double *value, char *said) {
    lookup = how;
    GCodeBuffer gb;
    const std::string line = std::string(text) + '\0';
    try {
        ExpressionParser parser(gb, line.c_str(), line.c_str() + line.size());
        const ExpressionValue v = parser.Parse();
        parser.CheckForExtraCharacters();
        switch (v.GetType()) {
        case TypeCode::None: return 0;
        case TypeCode::Bool: value[0] = v.bVal; return 1;
        case TypeCode::Int32: value[0] = v.iVal; return 2;
        case TypeCode::Float: value[0] = (double)v.fVal; value[1] = v.param; return 3;
        case TypeCode::CString: strcpy(said, v.sVal); return 4;
        case TypeCode::HeapString: strcpy(said, v.shVal.Get().Ptr()); return 4;
        case TypeCode::DateTime_tc: value[0] = (double)v.Get56BitValue(); return 5;
        default: strcpy(said, "another type"); return -1;
        }
    } catch (const GCodeException& e) {
        strncpy(said, e.text.c_str(), 250);
        return -1;
    }
}
