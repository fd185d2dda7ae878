// What ExpressionParser.cpp of RepRapFirmware needs of the board around it, and no more. Values of variables and of the
// object model, and which files are there, are asked of `lookup`. `test_reprapfirmware_itself.py` compiles it.
#pragma once
#include <cctype>
#include <cinttypes>
#include <climits>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <limits>
#include <memory>
#include <string>
#define _ecv_array
#define _ecv_null
#define _ecv_from
#define null
#define THROWS(x)
#define pre(...)
#define SUPPORT_CAN_EXPANSION 0
#define SUPPORT_OBJECT_MODEL 1
#define EXPRESSION_LIST_SEPARATOR ','
#define ARRAY_SIZE(_x) (sizeof(_x) / sizeof((_x)[0]))
#define THROW_INTERNAL_ERROR abort()
#include <General/SimpleMath.h>
#include <General/String.h>
#include <General/StringFunctions.h>
#include <General/StringRef.h>
#include <General/function_ref.h>

constexpr size_t StringLength100 = 100, MaxVariableNameLength = 120, MaxStringExpressionLength = 256;
constexpr size_t MaxFilenameLength = 120, MaxLiteralArrayElements = 10, MaxExpressionArrayIndices = 4;
constexpr size_t MaxFileReadArrayElements = 50;
constexpr unsigned int MaxFloatDigitsDisplayedAfterPoint = 7;
constexpr float Pi = 3.14159265f, DegreesToRadians = 0.01745329252f, RadiansToDegrees = 57.2957795f;
namespace StackUsage { constexpr uint32_t Throw = 0, Margin = 0; }
enum class GCodeResult : uint8_t { ok, warning, warningNotSupported, m291Cancelled, error };
enum class SoftwareResetReason { stackOverflow };
enum class OpenMode { read };
enum MessageType { WarningMessage };
enum class TypeCode : uint8_t {
    None, Bool, Char, CString, HeapString, Float, Int32, Uint32, Uint64, DateTime_tc, Duration, ObjectModel_tc,
    ObjectModelArray, HeapArray, IPAddress_tc, MacAddress_tc, DriverId_tc, Port, UniqueId_tc
};
class GCodeBuffer;
class ObjectModel;
struct ExpressionValue;
struct ObjectExplorationContext;
struct FileStore { bool Read(char&) { return false; } void Close() {} };
struct DriverId { uint8_t localDriver; explicit DriverId(uint32_t d = 0) : localDriver((uint8_t)d) {} };
struct ReadWriteLock {};
struct ReadLocker { template <class T> explicit ReadLocker(T&) {} };
struct WriteLocker { template <class T> explicit WriteLocker(T&) {} };
namespace Heap { extern ReadWriteLock heapLock; }
template <class T> struct ReadLockedPointer {
    T *p;
    explicit ReadLockedPointer(T *q) : p(q) {}
    ReadLockedPointer(std::nullptr_t, T *q) : p(q) {}
    T *Ptr() const { return p; }
};
struct TaskBase { static const void *GetCurrentTaskStackBase() { return nullptr; } };
inline const void *GetStackPointer() { return (const void *)~(uintptr_t)0; }
[[noreturn]] inline void SoftwareReset(SoftwareResetReason, const uint32_t *) { abort(); }
inline long random(uint32_t) { return 0; }
inline const char *SafeStrptime(const char *, const char *, tm *) { return nullptr; }

struct GCodeException {
    std::string text;
    explicit GCodeException(const char *m) : text(m) {}
    GCodeException(const GCodeBuffer *, int, const char *m) : text(m) {}
    GCodeException(const GCodeBuffer *, int, const char *m, const char *s) : text(std::string(m) + " " + s) {}
    GCodeException(const GCodeBuffer *, int, const char *m, uint32_t u) : text(std::string(m) + std::to_string(u)) {}
};

struct StringHandle {
    std::shared_ptr<std::string> s;
    StringHandle() {}
    explicit StringHandle(const char *p) : s(std::make_shared<std::string>(p)) {}
    ReadLockedPointer<const char> Get() const { return ReadLockedPointer<const char>(s->c_str()); }
    size_t GetLength() const { return s->size(); }
};

struct ArrayHandle {
    size_t GetNumElements() const { return 0; }
    bool GetElement(size_t, ExpressionValue&) const { return false; }
    void Allocate(size_t) { abort(); }
    void AssignElement(size_t, const ExpressionValue&) { abort(); }
};

struct ExpressionValue {
    TypeCode type = TypeCode::None;
    uint32_t param = 0;
    union { bool bVal; char cVal; float fVal; int32_t iVal; uint32_t uVal; const char *sVal; const ObjectModel *omVal; };
    StringHandle shVal;
    ArrayHandle ahVal;
    ExpressionValue() : sVal(nullptr) {}
    TypeCode GetType() const { return type; }
    bool IsStringType() const { return type == TypeCode::CString || type == TypeCode::HeapString; }
    void SetBool(bool b) { type = TypeCode::Bool; bVal = b; }
    void SetInt(int32_t i) { type = TypeCode::Int32; iVal = i; }
    void SetUnsigned(uint32_t u) { type = TypeCode::Uint32; uVal = u; }
    void SetChar(char c) { type = TypeCode::Char; cVal = c; }
    void SetFloat(float f, uint32_t digits = MaxFloatDigitsDisplayedAfterPoint) {
        type = TypeCode::Float;
        fVal = f;
        param = digits;
    }
    void SetCString(const char *s) { type = TypeCode::CString; sVal = s; }
    void SetStringHandle(StringHandle s) { type = TypeCode::HeapString; shVal = s; }
    void SetArrayHandle(ArrayHandle a) { type = TypeCode::HeapArray; ahVal = a; }
    void SetNull(std::nullptr_t) { type = TypeCode::None; }
    void SetDateTime(time_t t) { type = TypeCode::DateTime_tc; Set56BitValue(t); }
    void SetDriverId(DriverId d) { type = TypeCode::DriverId_tc; uVal = d.localDriver; }
    DriverId GetDriverIdValue() const { return DriverId(uVal); }
    void Set56BitValue(uint64_t v) { param = (uint32_t)(v >> 32) & 0x00FFFFFFu; uVal = (uint32_t)v; }
    uint64_t Get56BitValue() const { return ((uint64_t)param << 32) | uVal; }
    void AppendAsString(const StringRef& str) const;
};

struct ObjectModelArrayTableEntry {
    ReadWriteLock *lockPointer;
    size_t (*GetNumElements)(const ObjectModel *, const ObjectExplorationContext&);
    ExpressionValue (*GetElement)(const ObjectModel *, ObjectExplorationContext&);
};

struct ObjectExplorationContext {
    bool wantExists = false;
    int32_t indices[MaxExpressionArrayIndices];
    size_t provided = 0, counted = 0;
    ObjectExplorationContext() {}
    ObjectExplorationContext(const GCodeBuffer *, bool, bool exists, int, int) : wantExists(exists) {}
    void ProvideIndex(int32_t i) { indices[provided++] = i; }
    void AddIndex(int32_t) {}
    void AddIndex() { ++counted; }
    void RemoveIndex() {}
    int32_t GetLastIndex() const { return indices[counted - 1]; }
    bool WantExists() const { return wantExists; }
    bool ObsoleteFieldQueried() const { return false; }
};

class ObjectModel {
public:
    const ObjectModelArrayTableEntry *FindObjectModelArrayEntry(unsigned int) const { return nullptr; }
    ExpressionValue GetObjectValueUsingTableNumber(ObjectExplorationContext&, const void *, const char *, uint8_t) const;
};

struct Variable {
    ExpressionValue v;
    ExpressionValue GetValue() const { return v; }
};

class VariableSet {
public:
    const char *prefix;
    const Variable *Lookup(const char *name, size_t length, bool isParameter) const;
};

struct MachineState { int32_t GetIterations() const { return -1; } };

class GCodeBuffer {
public:
    VariableSet variables{"var."};
    MachineState state;
    unsigned GetLineNumber() const { return 0; }
    const MachineState& CurrentFileMachineState() const { return state; }
    GCodeResult GetLastResult() const { return GCodeResult::ok; }
    ExpressionValue GetM291Result() const { return ExpressionValue(); }
    const VariableSet& GetVariables() const { return variables; }
};

struct Platform {
    void MessageF(MessageType, const char *, const char *) {}
    bool SysFileExists(const char *name) const;
};

struct RepRap {
    Platform platform;
    ObjectModel model;
    VariableSet globals{"global."};
    Platform& GetPlatform() { return platform; }
    ReadLockedPointer<VariableSet> GetGlobalVariablesForReading() { return ReadLockedPointer<VariableSet>(&globals); }
    ExpressionValue GetObjectValueUsingTableNumber(ObjectExplorationContext& c, const void *d, const char *id, uint8_t t) {
        return model.GetObjectValueUsingTableNumber(c, d, id, t);
    }
};
extern RepRap reprap;

namespace MassStorage {
inline void CombineName(const StringRef&, const char *, const char *) {}
inline FileStore *OpenFile(const char *, OpenMode, uint32_t) { return nullptr; }
}
